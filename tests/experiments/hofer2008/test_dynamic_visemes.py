"""The benchmark of dynamic visemes on made-up motion, whose gestures are known."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from dynamic_visemes import (  # type: ignore[import-not-found]
    LEAST_FRAMES,
    SILENCE,
    SMOOTHING,
    centroids_of,
    filled,
    fit_dynamic_visemes,
    gesture_bounds,
    gesture_shape,
    main,
    similar_classes,
    unit_names,
)

from lipmotion.corpora.store import Corpus

POSES = np.array([[0.0, 2.0, 1.0], [4.0, 2.0, 5.0], [1.0, 5.0, 0.0]])
"""Three mouths: shut, open, spread."""


def motion(turns, lengths):
    """Return motion from pose to pose, at rest in each [shape=(T, 3)], and the frames in which it turns."""
    parts = [POSES[turns[:1]]]
    for (start, end), length in zip(pairwise(turns), lengths, strict=True):
        phase = (1 - np.cos(np.pi * np.arange(1, length + 1) / length)) / 2
        parts.append(POSES[start] + phase[:, None] * (POSES[end] - POSES[start]))
    return np.concatenate(parts), np.cumsum(lengths)


def test_gestures_meet_where_the_mouth_turns_to_within_the_smoothing():
    values, turns = motion([0, 1, 0, 2, 1, 0], [12, 20, 15, 9, 30])
    bounds = gesture_bounds(values)
    assert bounds[[0, -1]].tolist() == [0, len(values)]
    assert bounds[1:-1] == pytest.approx(turns[:-1], abs=SMOOTHING)


def test_no_gesture_is_shorter_than_the_states_of_a_unit():
    noise = np.random.default_rng(0).normal(size=(300, 3))
    lengths = np.diff(gesture_bounds(noise))
    assert len(lengths) > 10
    assert lengths.min() >= LEAST_FRAMES


def test_the_shape_of_a_gesture_does_not_depend_on_its_length():
    values, _ = motion([0, 1, 2], [10, 40])
    again, _ = motion([0, 1, 2], [30, 15])
    assert gesture_shape(values, 0, 11) == pytest.approx(gesture_shape(again, 0, 31), abs=0.05)
    assert gesture_shape(values, 10, 51) != pytest.approx(gesture_shape(values, 0, 11), abs=0.5)


def test_classes_are_the_kinds_of_movement():
    random = np.random.default_rng(1)
    motions, kinds = [], []
    for _ in range(12):
        turns = [0]
        while len(turns) < 9:
            turns.append(int(random.choice([pose for pose in range(3) if pose != turns[-1]])))
        values, _ = motion(turns, random.integers(10, 25, 8))
        motions.append(values + random.normal(scale=0.01, size=values.shape))
        kinds.append(list(pairwise(turns)))
    silences = [np.zeros(len(values), bool) for values in motions]
    visemes = fit_dynamic_visemes(motions, silences, 6)
    named = {}
    for values, silent, told in zip(motions, silences, kinds, strict=True):
        units, bounds = visemes.units(values, silent)
        assert len(units) == len(told) == len(bounds) - 1
        for unit, kind in zip(units, told, strict=True):
            named.setdefault(kind, set()).add(unit)
    assert len(named) == 6
    assert sorted(unit for units in named.values() for unit in units) == list(unit_names(6))


def test_silent_gestures_are_one_silence():
    values, turns = motion([0, 1, 0, 1, 2, 0, 1, 0], [15] * 7)
    silent = np.arange(len(values)) < turns[1]
    silent[turns[4] :] = True
    visemes = fit_dynamic_visemes([values], [silent], 3)
    units, bounds = visemes.units(values, silent)
    assert units[0] == units[-1] == SILENCE
    assert SILENCE not in units[1:-1]
    assert bounds == pytest.approx([0, *turns[1:5], len(values)], abs=1)


def test_k_means_finds_separate_groups_whatever_the_seed():
    random = np.random.default_rng(2)
    middles = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]])
    shapes = np.concatenate([middle + random.normal(scale=0.1, size=(20, 2)) for middle in middles])
    for seed in range(5):
        found = centroids_of(shapes, 3, seed)
        assert sorted(map(tuple, np.round(found).tolist())) == sorted(map(tuple, middles.tolist()))


def test_trees_may_ask_about_similar_classes():
    centroids = np.array([[0.0], [10.0], [0.1], [10.2], [30.0]])
    sets = set(similar_classes(centroids).values())
    assert {frozenset({"g00", "g02"}), frozenset({"g01", "g03"})} <= sets
    assert frozenset(unit_names(5)) not in sets


def test_motion_that_was_not_measured_is_filled():
    values = np.array([[1.0], [9.0], [3.0], [9.0]])
    assert filled(values, np.array([True, False, True, False])).ravel().tolist() == [1, 2, 3, 3]
    assert not filled(values, np.zeros(4, bool)).any()


@pytest.mark.long
def test_classes_are_compared_with_phones(
    toy_corpus: Corpus, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    units = "phone,dynamic-3,phone+dynamic-3"
    monkeypatch.setattr("sys.argv", ["", str(toy_corpus.path), "--split", "test", "--units", units, "--mixtures", "1"])
    main()
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["units"] for row in rows] == units.split(",")
    assert rows[0]["acc_gain_95"] == [0, 0]
    assert rows[1]["acc"] > 0.5
    assert rows[2]["gaussians"] == [1, 1]
