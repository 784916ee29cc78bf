import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import log_energy
from lipmotion.speech.sound.acoustic_conditions import make_babble
from lipmotion.speech.sound.analysed_audio import AnalysedAudio
from lipmotion.speech.sound.noise_reduction import BLOCK, reduce_noise
from lipmotion.types import Audio
from speech.made_voices import RATE_HZ, hiss, spoken

Samples = NDArray[np.float32]
CLEAR = np.concatenate([spoken(0), hiss(1, 3), spoken(1)])
TIME_S = np.arange(len(CLEAR)) / RATE_HZ
PAUSE = slice(len(spoken(0)) + RATE_HZ // 4, len(spoken(0)) + 3 * RATE_HZ // 4)


def add(noise: NDArray[np.floating], level: float) -> Samples:
    """Return the clear speech with noise of a root mean square beside its own."""
    return (CLEAR + level * CLEAR.std() * noise / noise.std()).astype(np.float32)


def reduce(samples: Samples) -> Samples:
    return reduce_noise(samples, log_energy(samples))


def white(count: int) -> NDArray[np.float64]:
    return np.random.default_rng(0).standard_normal(count)


def test_clear_speech_is_the_same_array():
    assert reduce(CLEAR) is CLEAR


def test_steady_noise_is_softer_in_pauses():
    noisy = add(white(len(CLEAR)), 0.3)
    assert reduce(noisy)[PAUSE].std() < 0.4 * noisy[PAUSE].std()


def test_speech_comes_closer_to_what_it_was():
    noisy = add(white(len(CLEAR)), 0.3)
    assert (reduce(noisy) - CLEAR).std() < 0.7 * (noisy - CLEAR).std()


def test_a_babble_of_voices_stays():
    voices = [Audio(spoken(seed), RATE_HZ) for seed in range(2, 8)]
    noisy = add(make_babble(voices, len(CLEAR)), 0.3)
    assert np.abs(reduce(noisy) - noisy).std() < 0.03 * (noisy - CLEAR).std()


def test_blocks_leave_no_seam():
    long, later = np.resize(add(white(len(CLEAR)), 0.3), 2 * BLOCK), 4 * RATE_HZ
    around = slice(BLOCK - RATE_HZ, BLOCK + RATE_HZ)
    assert reduce(long)[around] == pytest.approx(
        reduce(long[later:])[around.start - later : around.stop - later], abs=0.003
    )


@pytest.mark.parametrize("level", [1, 8])
@pytest.mark.parametrize("hertz", [(50, 150, 250), (120,), (200.4,)])
def test_a_voice_is_found_beneath_hum(hertz: tuple[float, ...], level: float):
    hum = np.sum([np.sin(2 * np.pi * each * TIME_S) for each in hertz], axis=0)
    clean, found = (
        [passage.first for passage in AnalysedAudio(sound, RATE_HZ).passages] for sound in (CLEAR, add(hum, level))
    )
    assert found == pytest.approx(clean, abs=30)


def test_a_voice_on_one_note_is_no_hum():
    time_s = np.arange(6 * RATE_HZ) / RATE_HZ
    sung = sum(np.sin(2 * np.pi * 150 * n * time_s) / n for n in range(1, 20)) * np.where(time_s % 1 < 0.85, 0.1, 1e-3)
    samples = sung.astype(np.float32)
    assert reduce(samples) is samples


@pytest.mark.parametrize("count", [400, 480, 1600])
def test_the_shortest_sound_is_kept_finite(count: int):
    samples = white(count).astype(np.float32)
    assert np.isfinite(reduce(samples)).all()
    assert reduce(samples).shape == samples.shape
