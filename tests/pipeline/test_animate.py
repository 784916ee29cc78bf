import json
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from lipmotion import Model, Request, animate, write
from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Constraints, Generation, Motion, Pin, Span, Timeline, Unit
from lipmotion.units import Lexicon
from testing.toy import ToySentence, toy_motion

Animate = Callable[..., Generation]


@pytest.fixture(scope="module")
def move(toy_model: Model, toy_sentence: ToySentence) -> Animate:
    return lambda *, constraints=None, **known: animate(
        Request(toy_sentence.audio, **known), model=toy_model, constraints=constraints
    )


@pytest.fixture(scope="module")
def transcript(toy_sentence: ToySentence) -> str:
    return " ".join(toy_sentence.words).capitalize() + "."


def frames_of(span: Span[Unit]) -> slice:
    return slice(round(span.start_s * 100), round(span.end_s * 100) + 1)


def agreement(found: Motion, sentence: ToySentence) -> float:
    """Return the correlation of the opening with the known one."""
    known = toy_motion(sentence.units, 100.0)
    count = min(len(known.values), len(found.values))
    return float(np.corrcoef(found["opening"][:count], known["opening"][:count])[0, 1])


def test_one_row_a_frame_of_10_ms(move, toy_sentence):
    result = move()
    frames = int(toy_sentence.audio.duration_s * 100) + 1
    assert result.motion.rate_hz == 100
    assert result.motion.names == ("opening", "width", "outer")
    assert result.motion.values.shape == result.variance.shape == (frames, 3)
    assert len(result.trace.frames) == frames
    assert result.trace.frames.max() < len(result.trace.states)
    assert np.isfinite(result.motion.values).all()
    assert (result.variance >= 0).all()
    assert result.units.spans[-1].end_s == pytest.approx(toy_sentence.audio.duration_s)


def test_the_lips_move_as_the_speakers_did(move, toy_sentence, transcript):
    assert agreement(move().motion, toy_sentence) > 0.9
    assert agreement(move(transcript=transcript).motion, toy_sentence) > 0.9
    assert agreement(move(units=toy_sentence.units).motion, toy_sentence) > 0.8


def test_a_file_its_name_and_its_samples_are_the_same(toy_model, toy_speech):
    first, second, third = (
        animate(speech, model=toy_model).motion.values
        for speech in (toy_speech, str(toy_speech), read_audio(toy_speech))
    )
    assert np.array_equal(first, second)
    assert np.array_equal(first, third)


def test_with_a_transcript_the_words_are_known(move, toy_sentence, transcript):
    result = move(transcript=transcript)
    assert [(s.label.phone, s.label.word) for s in result.units] == [
        (s.label.phone, s.label.word) for s in toy_sentence.units
    ]
    assert all(span.label.unit for span in result.units)


def test_the_mouth_closes_on_p_b_m_and_rests_in_silence(move, toy_sentence):
    result = move(units=toy_sentence.units)
    opening = result.motion["opening"]
    for span in toy_sentence.units:
        if span.label.phone in ("p", "b", "m"):
            assert opening[frames_of(span)].min() < 0.01
    first, last = toy_sentence.units.spans[0], toy_sentence.units.spans[-1]
    for silence in (opening[: round(first.end_s * 100) - 50], opening[round(last.start_s * 100) + 50 :]):
        assert silence.max() < 0.01
        assert silence.std() < 1e-3


def test_in_a_silent_recording_the_mouth_is_shut_and_still(toy_model):
    opening = animate(Audio(np.zeros(32_000, np.float32), 16_000), model=toy_model).motion["opening"]
    assert opening.max() < 0.01
    assert np.ptp(opening) < 1e-3


def test_edited_units_change_the_motion_where_they_are(move, toy_sentence):
    """``see`` becomes ``saw``: the mouth opens there, and nowhere else."""
    spans = toy_sentence.units.spans
    position = next(number for number, span in enumerate(spans) if span.label.phone == "iy")
    wider = [*spans[:position], replace(spans[position], label=Unit("aa")), *spans[position + 1 :]]
    before, after = move(units=toy_sentence.units), move(units=Timeline(tuple(wider)))
    inside = frames_of(spans[position])
    assert after.motion["opening"][inside].max() > 1.3 * before.motion["opening"][inside].max()
    far = inside.stop + 40
    assert after.motion.values[far:] == pytest.approx(before.motion.values[far:], abs=5e-3)
    assert after.units.spans[position].label.phone == "aa"


def test_units_need_no_recogniser(move):
    with pytest.raises(InputError, match="unknown phone 'AA' at 0"):
        move(units=Timeline((Span(0.0, 0.5, Unit("AA")),)))
    with pytest.raises(InputError, match="the units are an empty list"):
        move(units=Timeline(()))
    silent = Timeline((Span(0.0, 2.0, Unit("sil")),))
    assert move(units=silent).motion["opening"].max() < 0.01  # nothing is said


def test_pins_are_met_exactly(move, toy_sentence):
    vowel = next(span for span in toy_sentence.units if span.label.phone == "aa")
    middle_s = round((vowel.start_s + vowel.end_s) / 2, 2)
    pins = (Pin(middle_s, "opening", 0.05), Pin(middle_s, "width", 0.7), Pin(0.0, "opening", 0.1))
    free, pinned = move(), move(constraints=Constraints(pins))
    for pin in pins:
        frame = round(pin.time_s * 100)
        assert pinned.motion[pin.channel][frame] == pytest.approx(pin.value, abs=1e-9)
        assert pinned.variance[frame, pinned.motion.names.index(pin.channel)] == 0
    assert np.abs(np.diff(pinned.motion["opening"])).max() < 0.1  # the curve bends, it does not jump
    far = round(middle_s * 100) + 60
    same = pinned.motion.selected(free.motion.names)  # others say what was pinned
    assert same.values[far:] == pytest.approx(free.motion.values[far:], abs=1e-2)


def test_a_pin_that_cannot_be_met(move):
    for pin, message in (
        (
            Pin(0.5, "jaw", 0.1),
            r"cannot pin 'jaw' \(is it jawOpen\?\); channels that can be pinned: opening, width, outer",
        ),
        (Pin(9.0, "opening", 0.1), r"pin at 9.0 s lies outside the recording \(0 to 2.76 s\)"),
        (Pin(-0.1, "opening", 0.1), "pin at -0.1 s lies outside"),
        (Pin(0.5, "opening", float("nan")), "sets opening to nan, required a finite number"),
    ):
        with pytest.raises(InputError, match=message):
            move(constraints=Constraints((pin,)))


def test_constraints_and_units_that_are_none(move, toy_sentence):
    pins = Pin(0.5, "opening", 0.1), Pin(0.502, "opening", 0.2)
    with pytest.raises(InputError, match="the constraints are a tuple, required Constraints"):
        move(constraints=pins)
    with pytest.raises(InputError, match="units: found a list, required a path, or a Timeline"):
        Request(toy_sentence.audio, units=[])
    with pytest.raises(InputError, match="a unit is 'p', required a Unit"):
        Request(toy_sentence.audio, units=Timeline((Span(0, 1, "p"),)))
    for start_s, end_s in ((-math.inf, 0.5), (0.5, 1e308), (1e308, math.inf)):
        with pytest.raises(InputError, match=r"the units last from .* s, required times of this recording"):
            move(units=Timeline((Span(start_s, end_s, Unit("p")),)))


def test_a_lexicon_gives_pronunciations(move, caplog, toy_sentence):
    lexicon = Lexicon({"zyzzy": (("s", "iy"),)})
    result = move(transcript="Zyzzy bob papa mama", lexicon=lexicon)
    assert [s.label.phone for s in result.units] == [s.label.phone for s in toy_sentence.units]
    assert not caplog.records


def test_speech_that_cannot_be_used(toy_model, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        animate(tmp_path / "speech.wav", model=toy_model)
    with pytest.raises(InputError, match="need 16000 Hz, found 44100 Hz"):
        animate(Audio(np.zeros(44_100, np.float32), 44_100), model=toy_model)
    with pytest.raises(InputError, match="ndarray, required a path, or samples"):
        animate(np.zeros(16_000, np.float32), model=toy_model)  # type: ignore[arg-type]


def test_files_may_stand_for_model_and_transcript(toy_model, toy_model_file, toy_speech, tmp_path):
    (tmp_path / "said.txt").write_text("see papa")
    by_file = animate(str(toy_speech), model=str(toy_model_file), transcript=tmp_path / "said.txt")
    assert next(span.label.word for span in by_file.units if span.label.word) == "see"
    assert by_file.units == animate(toy_speech, model=toy_model, transcript="see papa").units
    with pytest.raises(InputError, match="no such transcript file"):
        animate(toy_speech, model=toy_model, transcript=tmp_path / "other.txt")


def test_units_beyond_the_recording_are_refused(toy_model, toy_sentence):
    units = Timeline(tuple(Span(i / 1e4, (i + 1) / 1e4, Unit("p")) for i in range(2000)))
    with pytest.raises(InputError, match=r"2000 units in time, required at most 1276 for 2.76 s of sound"):
        animate(Request(toy_sentence.audio, units=units), model=toy_model)


def test_the_same_bytes_again_whatever_the_number_of_threads(toy_model, toy_speech, tmp_path):
    write(animate(toy_speech, model=toy_model), tmp_path / "first.npz")
    with threadpool_limits(2, user_api="blas"):
        write(animate(toy_speech, model=toy_model), tmp_path / "second.npz")
    assert (tmp_path / "first.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()


def test_motion_says_which_model_it_is_of(move, tmp_path):
    """Attribution is not lost where the model is not given again."""
    write(move(), tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text())["model"]["corpus"] == "toy"


def test_confidence_is_of_every_frame_that_is_delivered(move, transcript, tmp_path):
    result = move(transcript=transcript)
    known = result.knowledge
    assert known.phones == 1.0
    assert len(result.confidence) == len(result.motion.values)
    assert 0 < result.confidence.min() <= result.confidence.max() <= 1
    stranger = replace(result, knowledge=replace(known, voice=0.0)).confidence
    friend = replace(result, knowledge=replace(known, voice=1.0)).confidence
    assert stranger is not None
    assert friend is not None
    assert (stranger < friend).all()
    slower = result.resampled(25.0)
    assert slower.confidence is not None
    assert len(slower.confidence) == len(slower.motion.values)
    assert result.selected(["width"]).confidence is None
    for name in ("a.npz", "a.json"):
        write(result, tmp_path / name)
    with np.load(tmp_path / "a.npz") as arrays:
        np.testing.assert_allclose(arrays["confidence"], result.confidence, rtol=1e-6)
    document = json.loads((tmp_path / "a.json").read_text("utf-8"))
    np.testing.assert_allclose(document["confidence"], result.confidence, atol=0.0051)
