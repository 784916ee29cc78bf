import tracemalloc

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.speech.features.mfcc import HOP, general_features, log_energy, mfcc, spectrum
from lipmotion.speech.sound import analysed_audio, speaker_similarity
from lipmotion.speech.sound.voice_activity import find_passages
from speech.made_voices import hiss, spoken
from testing.toy import ToySentence, toy_sentences


@pytest.fixture(scope="module")
def sentence() -> ToySentence:
    return toy_sentences(3)[0]


def of_samples(*parts: np.ndarray) -> analysed_audio.AnalysedAudio:
    return analysed_audio.analysed(types.Audio(np.concatenate(parts).astype(np.float32), 16_000))


def kinds(audio: analysed_audio.AnalysedAudio) -> list[np.ndarray]:
    return [audio.mfcc().values, audio.mfcc(0.88).values, audio.spectrum, audio.general_features, audio.log_energy]


def test_every_kind_is_that_of_the_passage_at_its_level(sentence: ToySentence) -> None:
    audio = analysed_audio.analysed(sentence.audio)
    (passage,) = audio.passages
    first, end = find_passages(log_energy(sentence.audio.samples))[0]
    lead, recorded = first - passage.first, sentence.audio.samples[first * HOP : end * HOP]
    sound = types.Audio(passage.audio.samples[lead * HOP :][: len(recorded)], 16_000)
    rows = slice(lead, lead + len(recorded) // HOP + 1)
    assert np.corrcoef(sound.samples, recorded)[0, 1] == pytest.approx(1)
    for warp, features in zip(speaker_similarity.WARPS, audio.mfcc_of_warps(speaker_similarity.WARPS), strict=True):
        np.testing.assert_allclose(
            passage.audio.mfcc(warp).values[rows], mfcc(sound, warp).values, rtol=0, atol=1e-5, equal_nan=False
        )
        assert features is audio.mfcc(warp)
        assert features.duration_s == sentence.audio.duration_s
    np.testing.assert_allclose(
        passage.audio.general_features[rows], general_features(sound), rtol=0, atol=1e-5, equal_nan=False
    )
    np.testing.assert_allclose(passage.audio.spectrum[rows], spectrum(sound), rtol=0, atol=1e-5, equal_nan=False)
    assert passage.audio.log_energy[rows] == pytest.approx(log_energy(sound.samples), abs=1e-5)


@pytest.mark.parametrize(
    ("before_s", "after_s", "units", "decibels"),
    [
        (0.5, 0.5, 0, 0), (0, 5, 0, 0), (5, 0, 0, 0), pytest.param(60, 0, 0, 0, marks=pytest.mark.long), (5, 0.5, 1, 0),
        (5, 0.5, 25, 0), (0, 0, 0, -40), (2, 2, 5, -6),
    ],
)  # fmt: skip
def test_silence_and_gain_change_no_features(before_s: float, after_s: float, units: float, decibels: float) -> None:
    """But that two frames at either end are left out, whose windows reach into it, and those of a noise as loud."""
    line = spoken(0)
    alone = of_samples(line)
    padded = of_samples(hiss(before_s, units), line * 10 ** (decibels / 20), hiss(after_s, units))
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
    one, other = spoken(1) * 10 ** (decibels / 20), spoken(0)
    audio = of_samples(hiss(2), one, hiss(3), other, hiss(4))
    first, second = audio.passages
    alone = of_samples(other, hiss(4))
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
        np.testing.assert_allclose(whole[place + 60 : place + 200], was[60:200], rtol=0, atol=2e-3, equal_nan=False)


def test_silence_between_passages_takes_no_memory() -> None:
    audio = of_samples(spoken(1), hiss(120), spoken(0))
    sizes = [passage.audio.spectrum.nbytes for passage in audio.passages]
    tracemalloc.start()
    rows = audio.joined_rows(lambda sound: sound.spectrum)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(sizes) == 2
    assert len({id(passage.audio.samples.base) for passage in audio.passages}) == 1  # is given back as one
    assert kept < sum(sizes) < rows.shape[0] * rows.shape[1]
    whole = np.concatenate([rows[:50], rows[50:7000], rows[7000:]])
    assert np.array_equal(whole, audio.spectrum)
    assert np.array_equal(rows[5000:5001], whole[5000:5001])
    assert (len(rows), rows.any(), rows.dtype) == (audio.frames, True, whole.dtype)


def test_where_nothing_is_said_all_features_are_0() -> None:
    hours = of_samples(hiss(120))
    tracemalloc.start()
    bands = hours.spectrum
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2 * bands.nbytes
    for samples in (np.zeros(16_000), 0.1 * np.sin(np.arange(16_000) / 5)):
        audio = of_samples(samples)
        assert audio.passages == ()
        assert all(len(values) == 101 and not values.any() for values in kinds(audio))


def test_a_passage_is_not_divided_further_what_keeps_its_features_stays_itself_and_so_does_a_stretch(
    sentence: ToySentence,
) -> None:
    audio = analysed_audio.analysed(sentence.audio)
    (passage,) = audio.passages
    assert (audio.is_passage, passage.audio.is_passage) == (False, True)
    assert passage.audio.frames == len(passage.audio.mfcc().values)
    assert analysed_audio.analysed(audio) is audio
    pairs = zip(kinds(passage.audio), kinds(passage.audio), strict=True)
    assert [once is again for once, again in pairs] == [True, True, True, False, True]  # recognition alone takes one
    warped = passage.audio.mfcc(0.88)
    audio.forget_warps()
    assert passage.audio.mfcc(0.88) is not warped
    features = mfcc(sentence.audio)
    assert analysed_audio.analysed(sentence.audio, features).mfcc() is features
    assert audio.samples is sentence.audio.samples
    assert audio.duration_s == sentence.audio.duration_s
    with pytest.raises(errors.InputError, match="need 16000 Hz, found 44100 Hz"):
        analysed_audio.analysed(types.Audio(np.zeros(44_100, np.float32), 44_100)).mfcc()
    stretch = audio.stretch(60, 160)
    assert len(stretch.samples) == 16_000
    for whole, part in zip(kinds(audio), kinds(stretch), strict=True):
        assert np.array_equal(part, whole[60:161])


@pytest.mark.parametrize("offset", [0.004, -0.02, 0.1])
def test_a_constant_offset_hides_no_pause(offset: float) -> None:
    """Not even an offset of the line alone, between zeros; what has none stays as it is, to the bit."""
    sound = np.concatenate([spoken(0), hiss(1, 3), spoken(1)])
    plain = of_samples(hiss(2), sound)
    for samples in (np.concatenate([hiss(2), sound]) + offset, np.concatenate([hiss(2), sound + offset])):
        audio = of_samples(samples)
        assert [(p.first, p.own) for p in audio.passages] == [(p.first, p.own) for p in plain.passages]
        np.testing.assert_allclose(audio.mfcc().values, plain.mfcc().values, rtol=0, atol=0.02, equal_nan=False)
    assert np.array_equal(of_samples(sound).samples, sound.astype(np.float32))


def test_a_damaged_sample_makes_nothing_quiet() -> None:
    sound = np.concatenate([hiss(2), spoken(0)])
    plain, damaged = of_samples(sound), of_samples(np.where(np.arange(len(sound)) == 9_000, 1e6, sound))
    assert [each.first for each in damaged.passages] == [each.first for each in plain.passages]
    np.testing.assert_allclose(damaged.mfcc().values[:, 0], plain.mfcc().values[:, 0], atol=1.5)


@pytest.mark.parametrize("size", [0.2, -0.5])
def test_neither_does_an_offset_that_changes(size: float) -> None:
    sound = np.concatenate([hiss(2), spoken(0), hiss(1, 3), spoken(1)])
    plain, moved = of_samples(sound), of_samples(sound + size * (np.arange(len(sound)) > 0.6 * len(sound)))
    assert [each.first for each in moved.passages] == pytest.approx([each.first for each in plain.passages], abs=10)
    assert np.abs(moved.mfcc().values - plain.mfcc().values).mean() < 0.1
