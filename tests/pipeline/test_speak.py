from itertools import pairwise

import numpy as np
import pytest

from lipmotion import Model, load_model, read_motion, speak, write
from lipmotion.pipeline.generate import speak as module
from lipmotion.pipeline.generate.speak import REST_S
from lipmotion.speech.voices.installed import default_voice, installed_voices
from lipmotion.types import Constraints, Pin, Span, SpokenText, Unit
from lipmotion.units import LIP_CLOSING, is_silent
from speech import stand_in_voice

TEXT = "Papa, see Bob. Mama!"


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in_voice.install(monkeypatch)


@pytest.fixture
def spoken(stand_in: None, toy_model: Model) -> SpokenText:  # noqa: ARG001
    return speak(TEXT, model=toy_model)


def phones(spoken: SpokenText) -> str:
    return " ".join(span.label.phone for span in spoken.generation.units)


def test_sound_and_motion_are_of_the_same_length(spoken):
    sound, generation = spoken
    assert sound.rate_hz == stand_in_voice.RATE_HZ
    assert len(generation.motion.values) == round(sound.duration_s * 100) + 1
    assert phones(spoken) == "sil p aa p ax s iy b aa b sp m aa m ax sil"
    assert list(dict.fromkeys(span.label.word for span in generation.units)) == ["", "papa", "see", "bob", "mama"]
    assert generation.outlook.words == "given units"


@pytest.mark.parametrize(
    "text", ["[00:00.5]Papa, see Bob.\n[00:02]Mama!", "1\n00:00:00,500 --> 00:00:02,000\nPAPA: {0}\n"]
)
@pytest.mark.usefixtures("stand_in")
def test_times_of_subtitles_are_not_spoken(toy_model, text, caplog):
    assert phones(speak(text.format(TEXT), model=toy_model)) == phones(speak(TEXT, model=toy_model))
    assert "subtitles" in caplog.text


def test_tags_in_the_text_are_moods_and_not_spoken(stand_in: None, toy_model: Model) -> None:  # noqa: ARG001
    sound, generation = speak("<smile> Papa, see Bob. [sad] Mama!", model=toy_model)
    assert sound.duration_s == speak(TEXT, model=toy_model).sound.duration_s
    first, second = generation.moods
    assert (first.time_s, first.mood, second.mood) == (0.0, "happy", "sad")
    assert second.time_s == pytest.approx(next(s.start_s for s in generation.units if s.label.phone == "m"))


def test_the_units_cover_all_with_rest_at_both_ends(spoken):
    units = spoken.generation.units
    assert units[0].start_s == 0
    assert units[0].end_s == pytest.approx(REST_S, abs=1e-3)
    assert units[-1].end_s == pytest.approx(spoken.sound.duration_s)
    assert units[-1].duration_s == pytest.approx(REST_S, abs=1e-3)
    assert all(a.end_s == b.start_s for a, b in pairwise(units))


def test_the_sound_is_silent_where_the_units_are(spoken):
    samples, rate_hz = spoken.sound.samples, spoken.sound.rate_hz
    assert 0 < np.abs(samples[: round(0.1 * rate_hz)]).max() < 0.02 * np.abs(samples).max()  # noise, no digital silence
    loud = {
        span.label.phone: float(np.abs(samples[round(span.start_s * rate_hz) : round(span.end_s * rate_hz)]).max())
        for span in spoken.generation.units
    }
    assert loud["aa"] > 5 * loud["sil"]


def test_sentences_go_to_the_synthesiser_a_few_at_a_time(
    stand_in: None,  # noqa: ARG001
    toy_model: Model,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as few:
        few.setattr(module, "SENTENCES_PER_RUN", 2)
        together = speak("See Bob. Mama. Papa. See. Bob.", model=toy_model)
    again = speak("See Bob. Mama. Papa. See. Bob.", model=toy_model)
    assert np.array_equal(together.sound.samples, again.sound.samples)
    assert np.array_equal(together.generation.motion.values, again.generation.motion.values)


def test_pins_hold(stand_in: None, toy_model: Model) -> None:  # noqa: ARG001
    told = Constraints((Pin(0.5, "opening", 0.07),))
    result = speak(TEXT, model=toy_model, constraints=told).generation
    assert result.motion["opening"][50] == pytest.approx(0.07)


def test_files(spoken, toy_model, tmp_path):
    names = ["a.mp4", "a.wav", "a.flac", "a.ogg", "a.json"]
    write(spoken.generation, [tmp_path / name for name in names], speech=spoken.sound, model=toy_model, fps=2)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert len(read_motion(tmp_path / "a.json")[1]) == len(spoken.generation.units)


def test_neighbouring_silences_are_one_and_short_ones_are_pauses():
    spans = [
        Span(0.3, 0.5, Unit("aa")), Span(0.5, 0.6, Unit("sil")), Span(0.6, 0.65, Unit("sil")),
        Span(0.65, 0.8, Unit("p")), Span(0.8, 1.0, Unit("sil")), Span(1.05, 1.2, Unit("p")),
    ]  # fmt: skip
    joined = [(span.label.phone, span.start_s, span.end_s) for span in module._join_silences(spans, 1.5)]
    assert joined == [
        ("sil", 0.0, 0.3), ("aa", 0.3, 0.5), ("sp", 0.5, 0.65), ("p", 0.65, 0.8), ("sil", 0.8, 1.05),
        ("p", 1.05, 1.2), ("sil", 1.2, 1.5),
    ]  # fmt: skip


@pytest.mark.skipif(not installed_voices(), reason="no synthesiser is installed")
def test_a_real_voice_closes_the_lips_in_time():
    spoken = speak("Please bring my mother the blue ball.", voice=default_voice(), model=load_model())
    opening = spoken.generation.motion["opening"]
    closing = [span for span in spoken.generation.units if span.label.phone in LIP_CLOSING]
    assert [span.label.word for span in closing] == ["please", "bring", "my", "mother", "blue", "ball"]
    for span in closing:
        assert opening[round(span.start_s * 100) : round(span.end_s * 100) + 1].min() < 0.1 * np.percentile(opening, 95)
    assert is_silent(spoken.generation.units[0].label.phone)
