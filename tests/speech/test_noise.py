from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import errors, types
from lipmotion.speech.features.mfcc import spectrum
from lipmotion.speech.sound import acoustic_conditions, resampling
from oracles.noise import ratio_db
from testing.formant_synthesiser import synthesise
from testing.toy import toy_sentences

RATE_HZ = 16_000
WORDS = [[("m", 0.1), ("aa", 0.2)], [("s", 0.15), ("iy", 0.2)], [("b", 0.08), ("ow", 0.25)], [("f", 0.1), ("ay", 0.3)]]


@cache
def talker(number: int, gain: float = 1.0, pause_s: float = 0.3) -> types.Audio:
    """Return a sentence of two words by one of several synthetic speakers."""
    phones = [("sil", pause_s), *WORDS[number % 4], ("sp", 0.1), *WORDS[(number + 1) % 4], ("sil", pause_s)]
    audio, _ = synthesise(phones, pitch_hz=100.0 + 20 * number, seed=number)
    return types.Audio(audio.samples * np.float32(gain), audio.rate_hz)


def added(clean: types.Audio, dirty: types.Audio) -> NDArray[np.float64]:
    return dirty.samples.astype(float) - clean.samples


def test_the_ratio_is_as_asked() -> None:
    for kind in acoustic_conditions.NOISE_KINDS:
        clean, talkers = talker(0, 0.3), [talker(1), talker(2), talker(3)]
        for snr_db in (-10.0, 12.5):
            dirty = acoustic_conditions.mix_noise(clean, kind, snr_db, talkers, seed=4)
            assert ratio_db(clean.samples, added(clean, dirty)) == pytest.approx(snr_db, abs=0.02)


def test_pauses_do_not_matter() -> None:
    paused = (talker(0, pause_s=pause_s) for pause_s in (0.2, 0.7))
    short, long = (added(clean, acoustic_conditions.mix_noise(clean, "white", 10)).std() for clean in paused)
    assert long == pytest.approx(short, rel=0.06)


def test_speech_is_found_between_the_pauses() -> None:
    phones = [("sil", 0.5), ("aa", 0.5), ("sil", 0.5)]
    spoken = np.flatnonzero(acoustic_conditions.mark_spoken(synthesise(phones)[0])) / RATE_HZ
    assert spoken[[0, -1]] == pytest.approx([0.5, 1.0], abs=0.06)


def test_talkers_are_as_loud_begin_again_and_start_by_chance_of_the_seed() -> None:
    one, two = talker(1), talker(2)
    alone = [acoustic_conditions.make_babble([one, types.Audio(one.samples, RATE_HZ)], 16_000, seed=0)]
    alone += [acoustic_conditions.make_babble([talker(1, 0.02), talker(1, 3.0)], 16_000, seed=0)]
    np.testing.assert_allclose(alone[0], alone[1], atol=1e-4)
    length = len(one.samples)
    twice = acoustic_conditions.make_babble([one, one], 3 * length, seed=2)
    np.testing.assert_allclose(twice[:length], twice[length : 2 * length], atol=1e-6)
    first, again, other = (acoustic_conditions.make_babble([one, two], 20_000, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    hisses = [acoustic_conditions.mix_noise(one, "white", 10, seed=seed).samples for seed in (1, 1, 2)]
    assert [np.array_equal(hisses[0], hiss) for hiss in hisses] == [True, True, False]


SILENT = types.Audio(np.zeros(16_000, np.float32), RATE_HZ)


def test_it_says_what_is_wrong() -> None:
    one, two = talker(0), talker(1)
    for kind, snr_db, audio, talkers, message in (
        ("pink", 10, one, [], "'pink'"),
        ("white", float("nan"), one, [], "nan dB"),
        ("white", 10, SILENT, [], "silent"),
        ("white", 10, types.Audio(np.zeros(0, np.float32), RATE_HZ), [], "400 samples"),
        ("white", 10, types.Audio(one.samples, 8000), [], "8000 Hz"),
        ("white", 10, types.Audio(np.full(16_000, np.nan, np.float32), RATE_HZ), [], "finite"),
        ("babble", 10, one, [two], "babble of 1"),
        ("babble", 10, one, [two, SILENT], "silent"),
        ("babble", 10, one, [two, types.Audio(talker(2).samples, 44_100)], "44100 Hz"),
        ("babble", 10, one, [two, one], "own babble"),
    ):
        with pytest.raises(errors.InputError, match=message):
            acoustic_conditions.mix_noise(audio, kind, snr_db, talkers)


@pytest.fixture(scope="module")
def voices() -> list[types.Audio]:
    """Three sentences."""
    return [sentence.audio for sentence in toy_sentences(3)]


def test_the_same_seed_gives_the_same_spectra_and_another_does_not(voices: list[types.Audio]) -> None:
    made = (acoustic_conditions.list_conditions(voices[0], voices, 4, [seed]) for seed in (7, 7, 8))
    one, same, other = ([each.values for each in versions] for versions in made)
    assert all(map(np.array_equal, one, same))
    assert not all(a.shape == b.shape and np.allclose(a, b) for a, b in zip(one, other, strict=True))


def test_the_length_follows_the_tempo_and_the_encoding_is_of_the_noise(voices: list[types.Audio]) -> None:
    versions = acoustic_conditions.list_conditions(voices[0], voices, 8, [1])
    recorded = versions[0].encoding.mean(axis=0)
    for version in versions:
        assert len(version.values) == pytest.approx(len(versions[0].values) / version.tempo, abs=2)
        assert len(version.encoding) == len(version.values)
        assert version.distortion < 0.3 or np.abs(version.encoding.mean(axis=0) - recorded).max() > 0.05


def test_conditions_leave_speech_recognisable_and_finite(voices: list[types.Audio]) -> None:
    found = [acoustic_conditions.apply_condition(voices[0], voices, np.random.default_rng(seed)) for seed in range(20)]
    assert all(np.isfinite(audio.samples).all() and len(audio.samples) == len(voices[0].samples) for audio, _ in found)
    distortions = np.array([distortion for _, distortion in found])
    assert distortions.min() == 0
    assert distortions.max() > 0.5
    quiet = np.mean([np.abs(spectrum(audio) - spectrum(voices[0])).mean() for audio, d in found if d < 0.2])
    covered = np.mean([np.abs(spectrum(audio) - spectrum(voices[0])).mean() for audio, d in found if d > 0.5])
    assert covered > 1.5 * quiet
    for seed in range(5):  # silence stays as it is
        audio, distortion = acoustic_conditions.apply_condition(SILENT, voices, np.random.default_rng(seed))
        assert not (audio.samples.any())
        assert not distortion


def test_bands_are_normalised(voices: list[types.Audio]) -> None:
    bands = spectrum(voices[0])
    assert bands.shape[1] == types.SPECTRUM_BANDS
    assert np.abs(bands.mean(axis=0)).max() < 1e-3
    assert 0.5 < bands.std() < 1.5
    louder = spectrum(types.Audio(voices[0].samples * 4, 16_000))
    np.testing.assert_allclose(louder, bands, atol=2e-2)


def tone(hertz: float, seconds: float, phase: float = 0.0) -> np.ndarray:
    return np.sin(2 * np.pi * hertz * np.arange(int(seconds * RATE_HZ)) / RATE_HZ + phase).astype(np.float32)


@pytest.mark.parametrize("edges_s", [(0.1, 0.3), (0.1, 0.3, 0.5, 0.8)])
def test_successive_pieces_of_one_recording_join_without_a_trace(edges_s: tuple[float, ...]) -> None:
    sound = np.random.default_rng(1).standard_normal(16_000).astype(np.float32)
    pieces = list(pairwise(edges_s))
    joined = resampling.overlap_pieces([sound] * len(pieces), pieces, RATE_HZ)
    np.testing.assert_allclose(joined.samples, sound[1600 : round(edges_s[-1] * RATE_HZ)], atol=1e-5)
    assert joined.starts == [round((start_s - 0.1) * RATE_HZ) for start_s, _ in pieces]


def test_a_tone_goes_on_in_phase() -> None:
    for phase in (1.0, 4.5):
        joined = resampling.overlap_pieces([tone(140, 0.5), tone(140, 0.5, phase)], [(0.0, 0.25), (0.25, 0.5)], RATE_HZ)
        spectrum = np.abs(np.fft.rfft(joined.samples[:7000] * np.hanning(7000)))
        frequencies = np.fft.rfftfreq(7000, 1 / RATE_HZ)
        assert spectrum[np.abs(frequencies - 140) > 30].max() < 0.02 * spectrum.max()
        assert abs(len(joined.samples) - 8000) <= resampling.REACH_S * RATE_HZ + 1


def test_a_shifted_piece_says_so() -> None:
    marked = tone(100, 0.5, np.pi / 2)
    joined = resampling.overlap_pieces([tone(100, 0.5), marked], [(0.0, 0.2), (0.25, 0.5)], RATE_HZ)
    begins = 0.25 + joined.shifts[1] / RATE_HZ
    place = joined.starts[1] + round((0.4 - begins) * RATE_HZ)
    np.testing.assert_allclose(joined.samples[place : place + 200], marked[6400:6600], atol=1e-5)
    assert joined.shifts[1] != 0


def test_a_short_first_piece_makes_no_click() -> None:
    joined = resampling.overlap_pieces([np.ones(8000, np.float32)] * 2, [(0.1, 0.101), (0.2, 0.4)], RATE_HZ)
    np.testing.assert_allclose(joined.samples, 1, atol=1e-6)
