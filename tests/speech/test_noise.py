"""Noise: its level is what was asked for, where something is said, whatever the pauses are."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.sound.acoustic_conditions import (
    NOISE_KINDS,
    add_noise,
    babble_noise,
    noisy_audio,
    spoken_samples,
    white_noise,
)
from lipmotion.testing.formant_synthesiser import synthesise
from lipmotion.types import Audio
from oracles.noise import ratio_db

RATE_HZ = 16_000
WORDS = [[("m", 0.1), ("aa", 0.2)], [("s", 0.15), ("iy", 0.2)], [("b", 0.08), ("ow", 0.25)], [("f", 0.1), ("ay", 0.3)]]


@cache
def talker(number: int, gain: float = 1.0, pause_s: float = 0.3) -> Audio:
    """Return a sentence of two words by one of several synthetic speakers."""
    phones = [("sil", pause_s), *WORDS[number % 4], ("sp", 0.1), *WORDS[(number + 1) % 4], ("sil", pause_s)]
    audio, _ = synthesise(phones, pitch_hz=100.0 + 20 * number, seed=number)
    return Audio(audio.samples * np.float32(gain), audio.rate_hz)


def added(clean: Audio, dirty: Audio) -> NDArray[np.float64]:
    return dirty.samples.astype(float) - clean.samples


def test_the_ratio_is_as_asked() -> None:
    for kind in NOISE_KINDS:
        clean, talkers = talker(0, 0.3), [talker(1), talker(2), talker(3)]
        for snr_db in (-10.0, 12.5):
            dirty = noisy_audio(clean, kind, snr_db, talkers, seed=4)
            assert ratio_db(clean.samples, added(clean, dirty)) == pytest.approx(snr_db, abs=0.02)


def test_the_level_of_the_noise_given_does_not_matter() -> None:
    clean, hiss = talker(0), white_noise(len(talker(0).samples), 1)
    same, other = add_noise(clean, hiss, 10), add_noise(clean, np.float32(20) * hiss, 10)
    np.testing.assert_allclose(other.samples, same.samples, atol=1e-6)


def test_pauses_do_not_change_the_level() -> None:
    short, long = talker(0, pause_s=0.2), talker(0, pause_s=0.7)
    levels = [added(clean, noisy_audio(clean, "white", 10)).std() for clean in (short, long)]
    assert levels[1] == pytest.approx(levels[0], rel=0.06)


def test_speech_is_found_between_the_pauses() -> None:
    phones = [("sil", 0.5), ("aa", 0.5), ("sil", 0.5)]
    spoken = np.flatnonzero(spoken_samples(synthesise(phones)[0])) / RATE_HZ
    assert spoken[[0, -1]] == pytest.approx([0.5, 1.0], abs=0.06)


def test_all_talkers_are_as_loud() -> None:
    alone = [babble_noise([talker(1), Audio(talker(1).samples, RATE_HZ)], 16_000, seed=0)]
    alone += [babble_noise([talker(1, 0.02), talker(1, 3.0)], 16_000, seed=0)]
    np.testing.assert_allclose(alone[0], alone[1], atol=1e-4)


def test_a_short_talker_begins_again() -> None:
    one = talker(1)
    length = len(one.samples)
    twice = babble_noise([one, one], 3 * length, seed=2)
    np.testing.assert_allclose(twice[:length], twice[length : 2 * length], atol=1e-6)


def test_talkers_start_by_chance_of_the_seed() -> None:
    talkers = [talker(1), talker(2)]
    first, again, other = (babble_noise(talkers, 20_000, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert not np.array_equal(white_noise(100, 1), white_noise(100, 2))


SILENT = Audio(np.zeros(16_000, np.float32), RATE_HZ)


def test_it_says_what_is_wrong() -> None:
    one, two = talker(0), talker(1)
    tone = Audio(np.sin(np.arange(16_000) * 0.3).astype(np.float32), RATE_HZ)
    for kind, snr_db, audio, talkers, message in (
        ("pink", 10, one, [], "'pink'"),
        ("white", float("nan"), one, [], "nan dB"),
        ("white", 10, SILENT, [], "silent"),
        ("white", 10, Audio(np.zeros(0, np.float32), RATE_HZ), [], "400 samples"),
        ("white", 10, Audio(one.samples, 8000), [], "8000 Hz"),
        ("white", 10, Audio(np.full(16_000, np.nan, np.float32), RATE_HZ), [], "finite"),
        ("babble", 10, one, [two], "babble of 1"),
        ("babble", 10, one, [two, SILENT], "silent"),
        ("babble", 10, one, [two, Audio(talker(2).samples, 44_100)], "44100 Hz"),
        ("babble", 10, one, [two, one], "own babble"),
    ):
        with pytest.raises(InputError, match=message):
            noisy_audio(audio, kind, snr_db, talkers)
    for noise, message in ((np.ones(3), "shape"), (np.zeros(16_000), "mean power"), (np.full(16_000, np.nan), "nan")):
        with pytest.raises(InputError, match=message):
            add_noise(tone, noise, 0)
    with pytest.raises(InputError, match="0 samples"):
        white_noise(0)
