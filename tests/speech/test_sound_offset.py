import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion_faces.corpus.sound_offset import measure_offset
from speech.made_voices import RATE_HZ, recorded_twice, speech_like


def scene(chance: np.random.Generator) -> np.ndarray:
    return np.concatenate([np.zeros(int(2.2 * RATE_HZ)), speech_like(chance, 4.0)])


@pytest.mark.parametrize("noise_db", [20, 5])
def test_the_offset_is_found_to_a_fraction_of_a_millisecond(noise_db: float) -> None:
    chance = np.random.default_rng(0)
    cut, before = int(chance.integers(0, RATE_HZ)), int(chance.integers(0, 3 * RATE_HZ))
    camera, recorder, late_s = recorded_twice(scene(chance), chance, cut, before, noise_db)
    for first, second, true_s in ((camera, recorder, late_s), (recorder, camera, -late_s)):
        assert measure_offset(first, second).late_s == pytest.approx(true_s, abs=0.0002)


def test_different_sounds_are_refused() -> None:
    chance = np.random.default_rng(3)
    one, other = (types.Audio(scene(chance).astype(np.float32), RATE_HZ) for _ in range(2))
    with pytest.raises(errors.InputError, match=r"is not clear: .*give the offset"):
        measure_offset(one, other)


@pytest.mark.parametrize("samples", [np.zeros(RATE_HZ), np.full(RATE_HZ, 0.5), np.zeros(50)])
def test_silence_is_refused(samples: np.ndarray) -> None:
    silent = types.Audio(samples.astype(np.float32), RATE_HZ)
    with pytest.raises(errors.InputError):
        measure_offset(silent, silent)


def test_sounds_of_two_rates_are_refused() -> None:
    sound = np.zeros(RATE_HZ, np.float32)
    with pytest.raises(errors.InputError, match="16000 and 48000 Hz, required one rate"):
        measure_offset(types.Audio(sound, RATE_HZ), types.Audio(sound, 48_000))
