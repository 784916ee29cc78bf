import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion_faces.corpus.sound_offset import ALIKE, BEEP, CLAP, find_marks, measure_offset
from speech.made_voices import RATE_HZ, beep, clap, recorded_twice, speech_like

MARK_S = 1.2


def scene(chance: np.random.Generator, mark: str, seconds: float = 4.0) -> np.ndarray:
    samples = np.concatenate([np.zeros(int(2.2 * RATE_HZ)), speech_like(chance, seconds)])
    if mark:
        made = clap(chance) if mark == CLAP else beep()
        samples[int(MARK_S * RATE_HZ) :][: len(made)] += made
    return samples


def test_the_offset_is_found():
    for mark, noise_db, most_ms in ((CLAP, 20, 0.2), (BEEP, 20, 1.0), ("", 20, 0.2), ("", 5, 0.2)):
        chance = np.random.default_rng(0)
        cut, before = int(chance.integers(0, RATE_HZ)), int(chance.integers(0, 3 * RATE_HZ))
        camera, recorder, late_s = recorded_twice(scene(chance, mark), chance, cut, before, noise_db)
        for first, second, true_s in ((camera, recorder, late_s), (recorder, camera, -late_s)):
            found = measure_offset(first, second)
            assert abs(found.late_s - true_s) * 1000 <= most_ms
            assert found.how in {mark, ALIKE}
        if mark:
            assert measure_offset(camera, recorder).how == mark


def test_a_mark_alone_is_enough():
    """The recorder has the mark and then another speaker."""
    for mark, most_ms in ((CLAP, 0.2), (BEEP, 2.0)):
        chance = np.random.default_rng(7)
        both = scene(chance, mark)
        camera, _, _ = recorded_twice(both, chance, 3_000, 0)
        apart = both.copy()
        apart[int((MARK_S + 0.4) * RATE_HZ) :] = 0
        _, recorder, late_s = recorded_twice(apart, chance, 3_000, 20_000)
        found = measure_offset(camera, recorder)
        assert found.how == mark
        assert abs(found.late_s - late_s) * 1000 <= most_ms


def test_claps_and_beeps_are_found_where_they_are():
    chance = np.random.default_rng(1)
    samples = scene(chance, CLAP) + 1e-3 * chance.normal(size=int(6.2 * RATE_HZ))
    samples[: RATE_HZ // 4] += beep(2000.0)[: RATE_HZ // 4]
    marks = find_marks(types.Audio(samples.astype(np.float32), RATE_HZ))
    assert [(mark.kind, round(mark.time_s, 1)) for mark in marks if mark.time_s < 2] == [(BEEP, 0.0), (CLAP, MARK_S)]
    assert marks[0].hertz == pytest.approx(2000, abs=32)


def test_speech_holds_no_beep():
    chance = np.random.default_rng(2)
    marks = find_marks(types.Audio(scene(chance, "").astype(np.float32), RATE_HZ))
    assert not [mark for mark in marks if mark.kind == BEEP]


def test_different_sounds_are_refused():
    chance = np.random.default_rng(3)
    one, other = (types.Audio(scene(chance, "").astype(np.float32), RATE_HZ) for _ in range(2))
    with pytest.raises(errors.InputError, match=r"is not clear: no clap and no beep is in both.*give the offset"):
        measure_offset(one, other)


def test_silence_and_two_rates_are_refused():
    for samples in (np.zeros(RATE_HZ), np.full(RATE_HZ, 0.5), np.zeros(50)):
        silent = types.Audio(samples.astype(np.float32), RATE_HZ)
        with pytest.raises(errors.InputError):
            measure_offset(silent, silent)
        assert find_marks(silent) == ()
    sound = np.zeros(RATE_HZ, np.float32)
    with pytest.raises(errors.InputError, match="16000 and 48000 Hz, required one rate"):
        measure_offset(types.Audio(sound, RATE_HZ), types.Audio(sound, 48_000))
