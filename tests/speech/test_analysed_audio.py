import tracemalloc
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any
from zlib import crc32

import numpy as np
import pytest

from lipmotion import Model, animate, load_model
from lipmotion.errors import InputError
from lipmotion.speech.features import analysed_audio as module
from lipmotion.speech.features import mfcc as front_end
from lipmotion.speech.features.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.features.mfcc import HOP, log_energy, mfcc, spectrum
from lipmotion.speech.features.speaker_similarity import JUDGED_FRAMES, WARPS
from lipmotion.speech.recognition.agreement import agreement_score
from lipmotion.speech.recognition.general import general_features
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.voice_activity import find_passages
from lipmotion.types import Audio
from lipmotion.units import Lexicon
from testing.toy import ToySentence, toy_sentences


@pytest.fixture(scope="module")
def sentence() -> ToySentence:
    return toy_sentences(3)[0]


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> Counter[tuple[str, bytes, int]]:
    """Counts what the front end computes: by filter bank or energy, and samples."""
    counts: Counter[tuple[str, bytes, int]] = Counter()

    def counting(kind: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def counted(samples: np.ndarray, banks: Sequence[np.ndarray] = (np.zeros(0),)) -> Any:
            counts.update((kind, bank.tobytes(), crc32(samples.tobytes())) for bank in banks)
            return function(samples, banks) if kind == "filters" else function(samples)

        return counted

    monkeypatch.setattr(front_end, "log_mels", counting("filters", front_end.log_mels))
    counted_energy = counting("energy", front_end.log_energy)
    for owner in (front_end, module):
        monkeypatch.setattr(owner, "log_energy", counted_energy)
    return counts


def of_samples(*parts: np.ndarray) -> AnalysedAudio:
    return analysed(Audio(np.concatenate(parts).astype(np.float32), 16_000))


def whole_frames(number: int) -> np.ndarray:
    samples = toy_sentences(3)[number].audio.samples
    return samples[: len(samples) // HOP * HOP]


def silence(seconds: float, units: float = 0.0) -> np.ndarray:
    return np.random.default_rng(0).uniform(-units, units, round(16_000 * seconds)) / 32768


def kinds(audio: AnalysedAudio) -> list[np.ndarray]:
    return [audio.mfcc().values, audio.mfcc(0.88).values, audio.spectrum, audio.general_features, audio.log_energy]


def test_every_kind_is_that_of_the_passage_at_its_level(sentence: ToySentence) -> None:
    audio = analysed(sentence.audio)
    (passage,) = audio.passages
    first, end = find_passages(log_energy(sentence.audio.samples))[0]
    lead, recorded = first - passage.first, sentence.audio.samples[first * HOP : end * HOP]
    sound = Audio(passage.audio.samples[lead * HOP :][: len(recorded)], 16_000)
    rows = slice(lead, lead + len(recorded) // HOP + 1)
    assert np.corrcoef(sound.samples, recorded)[0, 1] == pytest.approx(1)
    for warp, features in zip(WARPS, audio.mfcc_of_warps(WARPS), strict=True):
        assert passage.audio.mfcc(warp).values[rows] == pytest.approx(mfcc(sound, warp).values, abs=1e-5)
        assert features is audio.mfcc(warp)
        assert features.duration_s == sentence.audio.duration_s
    assert passage.audio.general_features[rows] == pytest.approx(general_features(sound), abs=1e-5)
    assert passage.audio.spectrum[rows] == pytest.approx(spectrum(sound), abs=1e-5)
    assert passage.audio.log_energy[rows] == pytest.approx(log_energy(sound.samples), abs=1e-5)


def test_features_are_normalised_over_the_passage_alone() -> None:
    audio = of_samples(silence(5), whole_frames(0), silence(20))
    (passage,) = audio.passages
    ((first, end),) = find_passages(log_energy(audio.samples))
    values = passage.audio.mfcc().values[first - passage.first :][: end - first + 1]
    assert values.mean(axis=0) == pytest.approx(0, abs=1e-3)
    assert values.std(axis=0) == pytest.approx(1, abs=1e-3)
    assert np.abs(mfcc(audio).values[first:end].mean(axis=0)).max() > 1  # over the whole recording it would not be


@pytest.mark.parametrize(
    ("before_s", "after_s", "units", "decibels"),
    [
        (0.5, 0.5, 0, 0),
        (0, 5, 0, 0),
        (5, 0, 0, 0),
        pytest.param(60, 0, 0, 0, marks=pytest.mark.long),
        (5, 0.5, 1, 0),
        (5, 0.5, 25, 0),
        (0, 0, 0, -40),
        (2, 2, 5, -6),
    ],
)
def test_silence_and_gain_change_no_features(before_s: float, after_s: float, units: float, decibels: float) -> None:
    """But that two frames at either end are left out, whose windows reach into it, and those of a noise as loud."""
    line = whole_frames(0)
    alone = of_samples(line)
    padded = of_samples(silence(before_s, units), line * 10 ** (decibels / 20), silence(after_s, units))
    (passage,), (found,) = alone.passages, padded.passages
    place = round(100 * before_s)
    assert found.first - place == pytest.approx(passage.first, abs=25 if units > 4 else 5)
    heard = slice(passage.first + 60, passage.first + 60 + 100)
    for was, now in zip(kinds(alone), kinds(padded), strict=True):
        differences = now[place + heard.start : place + heard.stop] - was[heard]
        assert np.abs(differences).mean() < (0.3 if units > 4 else 0.05) * was[heard].std()


@pytest.mark.parametrize("decibels", [0, -30])
def test_features_are_joined_from_those_of_passages(decibels: float) -> None:
    """As long as the recording, each passage in its place, and those of silence between and around them."""
    one, other = whole_frames(1) * 10 ** (decibels / 20), whole_frames(0)
    audio = of_samples(silence(2), one, silence(3), other, silence(4))
    first, second = audio.passages
    alone = of_samples(other, silence(4))
    place = 500 + len(one) // HOP
    assert 200 < first.own.stop == second.own.start < place
    assert (first.own.start, second.own.stop) == (0, audio.frames)
    assert audio.frames == len(audio.samples) // HOP + 1
    for whole, of_first, of_second, was in zip(*map(kinds, (audio, first.audio, second.audio, alone)), strict=True):
        assert len(whole) == audio.frames
        assert np.isfinite(whole).all()
        for passage, part in ((first, of_first), (second, of_second)):
            inside = slice(max(passage.first, 0), min(passage.first + len(part), audio.frames))
            assert np.array_equal(whole[inside], part[inside.start - passage.first : inside.stop - passage.first])
        assert np.ptp(whole[: first.first], axis=0) == pytest.approx(0)
        assert np.ptp(whole[second.first + len(of_second) :], axis=0) == pytest.approx(0)
        assert whole[place + 60 : place + 200] == pytest.approx(was[60:200], abs=2e-3)


def test_silence_between_passages_takes_no_memory() -> None:
    audio = of_samples(whole_frames(1), silence(120), whole_frames(0))
    sizes = [passage.audio.spectrum.nbytes for passage in audio.passages]
    tracemalloc.start()
    rows = audio.joined_rows(lambda sound: sound.spectrum)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(sizes) == 2
    assert kept < sum(sizes) < rows.shape[0] * rows.shape[1]
    whole = np.concatenate([rows[:50], rows[50:7000], rows[7000:]])
    assert np.array_equal(whole, audio.spectrum)
    assert np.array_equal(rows[5000:5001], whole[5000:5001])
    assert (len(rows), rows.any(), rows.dtype) == (audio.frames, True, whole.dtype)


def test_where_nothing_is_said_all_features_are_0() -> None:
    for samples in (np.zeros(16_000), 0.1 * np.sin(np.arange(16_000) / 5)):
        audio = of_samples(samples)
        assert audio.passages == ()
        for values in kinds(audio):
            assert len(values) == 101
            assert not values.any()


def test_a_passage_is_not_divided_further_and_what_keeps_its_features_stays_itself(sentence: ToySentence) -> None:
    audio = analysed(sentence.audio)
    (passage,) = audio.passages
    assert not audio.is_passage
    assert passage.audio.is_passage
    assert passage.audio.frames == len(passage.audio.mfcc().values)
    assert analysed(audio) is audio
    assert audio.samples is sentence.audio.samples
    assert audio.duration_s == sentence.audio.duration_s
    with pytest.raises(InputError, match="need 16000 Hz, found 44100 Hz"):
        analysed(Audio(np.zeros(44_100, np.float32), 44_100)).mfcc()


def test_a_stretch_has_the_features_of_the_whole(sentence: ToySentence) -> None:
    audio = analysed(sentence.audio)
    stretch = audio.stretch(60, 160)
    assert len(stretch.samples) == 16_000
    for whole, part in zip(kinds(audio), kinds(stretch), strict=True):
        assert np.array_equal(part, whole[60:161])


def test_features_that_are_known_are_not_computed(sentence: ToySentence, computed: Counter[Any]) -> None:
    features = mfcc(sentence.audio)
    computed.clear()
    assert analysed(sentence.audio, features).mfcc() is features
    assert not computed


def long_audio() -> Audio:
    sentences = toy_sentences(12)
    samples = np.concatenate([sentence.audio.samples for sentence in sentences])
    assert len(samples) / 160 > JUDGED_FRAMES
    return Audio(samples, 16_000)


@pytest.mark.parametrize("kind", ["fast", "general", pytest.param("auto", marks=pytest.mark.long)])
@pytest.mark.parametrize("is_long", [False, pytest.param(True, marks=pytest.mark.long)])
def test_each_kind_is_computed_once_for_all_that_is_done_with_a_recording(
    sentence: ToySentence, kind: str, is_long: bool, computed: Counter[Any]
) -> None:
    audio: AnalysedAudio = analysed(long_audio() if is_long else sentence.audio)
    recogniser = Recogniser(load_model().phones, kind)
    recognised = recogniser.recognise(audio, audio.mfcc())
    recogniser.align_phones(audio, audio.mfcc(), recognised)
    aligned = recogniser.align(audio, audio.mfcc(), sentence.words, Lexicon())
    agreement_score(audio, aligned)
    assert set(computed.values()) == {1}
    if not is_long:  # features at no warp and general ones, and at the other warps; of the longest passage alone
        assert sum(what == "filters" for what, *_ in computed) == (2 if kind == "general" else 6)


def test_animate_computes_each_kind_once(toy_model: Model, sentence: ToySentence, computed: Counter[Any]) -> None:
    animate(sentence.audio, model=toy_model, transcript=" ".join(sentence.words))
    assert set(computed.values()) == {1}


def test_features_of_silence_take_no_more_memory_than_they_are() -> None:
    audio = AnalysedAudio(np.zeros(120 * 16_000, np.float32), 16_000)
    assert not audio.passages
    tracemalloc.start()
    bands = audio.spectrum
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert bands.shape == (audio.frames, 40)
    assert not bands.any()
    assert most < 2 * bands.nbytes


@pytest.mark.parametrize("offset", [0.004, -0.02, 0.1])
def test_a_constant_offset_hides_no_pause(offset: float) -> None:
    """Not even an offset of the line alone, between zeros; what has none stays as it is, to the bit."""
    sound = np.concatenate([whole_frames(0), silence(1, 3), whole_frames(1)])
    plain = of_samples(silence(2), sound)
    for samples in (np.concatenate([silence(2), sound]) + offset, np.concatenate([silence(2), sound + offset])):
        audio = of_samples(samples)
        assert [(p.first, p.own) for p in audio.passages] == [(p.first, p.own) for p in plain.passages]
        assert audio.mfcc().values == pytest.approx(plain.mfcc().values, abs=0.02)
    assert np.array_equal(of_samples(sound).samples, sound.astype(np.float32))
