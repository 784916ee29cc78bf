import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmm.synthetic import PAUSE, SILENCE, known_hmm, speaker
from lipmotion.hmm import align, loudness, network

ROOM = -10.0  # the level of the room in ``line``, in which the loudest moments have 0


def energy(seed: int = 0) -> np.ndarray:
    """Forty quiet frames, sixty loud ones, forty quiet ones."""
    return np.repeat([0.0, 10.0, 0.0], [40, 60, 40]) + np.random.default_rng(seed).normal(0, 0.5, 140)


def line(before: int = 60, after: int = 60, seed: int = 1) -> np.ndarray:
    """Six syllables with closures between them, and a pause in the middle, in a room that is heard."""
    syllables = np.tile(np.r_[-6 * np.cos(np.linspace(0.5, np.pi - 0.5, 25)) ** 2, np.full(6, ROOM + 1)], 3)
    level = np.concatenate([np.full(frames, ROOM) for frames in (before, 25, after)])
    level = np.insert(level, np.repeat([before, before + 25], len(syllables)), np.tile(syllables, 2))
    return level + np.random.default_rng(seed).normal(0, 0.3, len(level))


@given(offset=st.floats(-50, 50))
def test_loud_is_relative_to_the_recording(offset):
    loud = np.nonzero(loudness.find_loud_frames(energy() + offset))[0]
    assert (loud[0], loud[-1]) == pytest.approx((40, 99), abs=1)
    assert len(loud) == loud[-1] - loud[0] + 1


@pytest.mark.parametrize("frames", [50, 500, 6000])
@pytest.mark.parametrize("other", [ROOM - 15, ROOM - 3, ROOM + 3])
def test_another_silence_around_a_recording_changes_no_level(frames: int, other: float):
    alone = line()
    pad = other + np.random.default_rng(2).normal(0, 0.3, frames)  # digital, or of another noise
    padded = np.r_[pad, alone, pad]
    own = slice(frames, frames + len(alone))
    assert loudness.measure_levels(padded) == pytest.approx(loudness.measure_levels(alone), abs=0.1)
    assert loudness.measure_levels(alone) == pytest.approx((-2, ROOM), abs=1.5)
    assert np.array_equal(loudness.find_spoken_frames(padded)[own], loudness.find_spoken_frames(alone))
    assert loudness.find_quiet_frames(padded)[: frames - 20].all() == (other < -loudness.QUIET_DROP - 2)


def test_short_pauses_are_part_of_the_sound_and_clicks_are_none():
    sound = np.zeros(400, bool)
    sound[100:150] = sound[150 + loudness.PAUSE_FRAMES - 1 : 250] = True
    sound[300 : 300 + loudness.MIN_FRAMES - 1] = True
    assert loudness.find_sound_runs(sound) == [(100, 250)]
    assert loudness.find_sound_runs(sound, 10) == [(100, 150), (150 + loudness.PAUSE_FRAMES - 1, 250)]
    assert loudness.find_sound_runs(np.zeros(9, bool)) == []


def stranger():
    """A speaker whose units are more similar to the models' silence than to their units, and as loud as these."""
    who = speaker(spread=2.0)
    features, edges = who.say(np.random.default_rng(3), (SILENCE, "a", "b", SILENCE))
    spoken = slice(edges[1], edges[3])
    features[spoken] = features[spoken] * 0.1 + who.means[SILENCE][0]
    loud = np.zeros(len(features), bool)
    loud[spoken] = True
    return known_hmm(who), features, edges, loud


def test_loud_frames_are_neither_aligned_with_silence_nor_chosen_as_pauses():
    hmm, features, edges, loud = stranger()
    units, words = (SILENCE, "a", "b", SILENCE), ((("a",),), (("b",),))
    free = network.compute_log_likelihoods(hmm, features)
    bound = network.penalise(hmm, free, loud, silent=True)
    without, bounds = align.align_units(hmm, free, units), align.align_units(hmm, bound, units)
    assert without[3] - without[1] < 8
    assert (bounds[1], bounds[3]) == (edges[1], edges[3])
    for densities, pauses in ((free, True), (bound, False)):
        parts = [item.spoken for item in align.place_words(hmm, densities, words, PAUSE)]
        assert (PAUSE in [unit for part in parts for unit in part.units]) == pauses


def test_quiet_frames_are_far_under_the_loud_ones_and_away_from_them():
    level = np.full(200, -loudness.QUIET_DROP - 1)
    level[50:120] = 0
    level[70:76] = -loudness.QUIET_DROP - 9  # the closure of a stop
    quiet = loudness.find_quiet_frames(level.astype(np.float32))
    assert quiet[: 50 - loudness.QUIET_REACH_FRAMES].all()
    assert quiet[120 + loudness.QUIET_REACH_FRAMES :].all()
    assert not quiet[50 - loudness.QUIET_REACH_FRAMES : 120 + loudness.QUIET_REACH_FRAMES].any()


def test_quiet_frames_are_silence_whatever_they_sound_like():
    hmm, features, _, _loud = stranger()
    quiet = np.zeros(len(features), bool)
    quiet[:4] = True
    free_of_speech = network.penalise(hmm, network.compute_log_likelihoods(hmm, features), quiet, silent=False)
    values = free_of_speech.log_density(2, 6, None)
    free = [hmm.table.density(SILENCE, 0), hmm.table.density(PAUSE, 0)]
    assert set(values[:2].argmax(axis=1)) <= {hmm.table.density(SILENCE, k) for k in range(3)} | set(free)
    plain = network.compute_log_likelihoods(hmm, features).log_density(2, 6, None)
    assert np.array_equal(values[2:], plain[2:])
    assert np.array_equal(values[:, free], plain[:, free])
