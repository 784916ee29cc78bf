from dataclasses import replace

import numpy as np
import pytest

import lipmotion
from lipmotion import compare
from lipmotion.errors import InputError
from lipmotion.measures import curves
from lipmotion.types import WEIGHT, Channel, Motion, Track
from meshes.speech import motion

SPEECH = motion()


def weights(*names: str, frames: int = 60, rate_hz: float = 60.0) -> Motion:
    time_s = np.arange(frames) / rate_hz
    values = np.stack([0.5 + 0.4 * np.sin((3 + i) * time_s) for i in range(len(names))], axis=1)
    return Motion(values, rate_hz, tuple(Channel(name, WEIGHT) for name in names))


def moved(changed: Motion, channel: str, values: np.ndarray) -> Motion:
    every = np.array(changed.values, float)
    every[:, changed.column(channel)] = values
    return replace(changed, values=every)


def test_figures_are_those_of_the_measures():
    late = replace(SPEECH, values=0.5 * np.roll(SPEECH.values, 3, axis=0))
    (pair,) = compare(SPEECH, late)["others"]
    columns = [SPEECH.column(name) for name in pair["channels"]]
    sides = ([late.values[:, columns]], [SPEECH.values[:, columns]])
    for name, of in (
        ("acc", curves.pooled_correlation),
        ("variance", curves.global_variance_ratio),
        ("jerk", curves.jerk_ratio),
        ("nrmse", curves.normalised_rmse),
    ):
        assert [row[name] for row in pair["channels"].values()] == pytest.approx(of(*sides)), name
    assert pair["channels"]["opening"]["lag_ms"] == pytest.approx(3000 / SPEECH.rate_hz, abs=10)
    assert pair["acc"] == pytest.approx(np.mean(curves.pooled_correlation(*sides)))


def test_points_are_compared_in_millimetres():
    shifted = moved(SPEECH, "x_13", SPEECH["x_13"] + 0.1)
    points = compare(SPEECH, shifted)["others"][0]["points"]
    assert points["lip_vertex_error_mm"] == pytest.approx(9)
    assert points["landmark_distance_mm"] == pytest.approx(9 / points["points"])
    assert points["upper_face_deviation_mm"] is None


def test_rates_and_lengths_are_brought_together_and_said():
    half = Motion(SPEECH.values[: len(SPEECH.values) // 2], SPEECH.rate_hz, SPEECH.channels).resampled(25.0)
    (pair,) = compare(SPEECH, half)["others"]
    assert pair["rate_hz"] == 25.0
    assert pair["frames"] == len(half.values)
    assert pair["channels"]["opening"]["acc"] == pytest.approx(1)
    assert f"the reference is resampled from {SPEECH.rate_hz:g} to 25 frames a second" in pair["notes"][0]
    assert pair["notes"][1].endswith("s are compared")


def test_frames_without_a_face_are_left_out():
    values = np.array(SPEECH.values)
    values[10:15] = 100
    seen = np.ones(len(values), bool)
    seen[10:15] = False
    (pair,) = compare(SPEECH, Track(replace(SPEECH, values=values), seen))["others"]
    assert pair["channels"]["opening"]["rmse"] == pytest.approx(0, abs=1e-12)
    assert pair["frames"] == len(values) - 5
    assert pair["notes"] == [f"5 of {len(values)} frames are left out: the face was not measured"]


def test_blendshapes_are_found_however_they_are_spelt():
    reference = weights("jawOpen", "browInnerUp", "mouthClose")
    other = weights("Face.JawOpen", "brow_inner_up")
    (pair,) = compare(reference, other)["others"]
    assert list(pair["channels"]) == ["jawOpen", "browInnerUp"]
    assert "mouthClose" in pair["notes"][0]
    still = moved(other, "brow_inner_up", np.full(60, 0.2))
    upper = compare(reference, still)["others"][0]["upper_face"]
    wanted = curves.upper_face_deviation(
        [np.zeros((60, 1, 1))], [np.array(reference.values[:, 1:2, None], float)], np.zeros((1, 1))
    )
    assert upper == {"curves": 1, "deviation": pytest.approx(wanted)}
    assert wanted > 0.05


def test_what_does_not_move_is_named():
    flat = moved(weights("jawOpen", "mouthClose"), "mouthClose", np.zeros(60))
    (pair,) = compare(flat, flat)["others"]
    assert pair["notes"] == ["left out, for they do not move in the reference: mouthClose"]
    assert list(pair["channels"]) == ["jawOpen"]
    assert compare(*[moved(flat, "jawOpen", np.zeros(60))] * 2)["others"][0]["acc"] is None


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (Motion(np.zeros((60, 1)), 60.0, (Channel("jawOpen"),)), r"it has jawOpen \(eye_distance\), required one of"),
        (weights("jawOpen", frames=0), "motion 1: the motion has no frames"),
        (moved(weights("jawOpen"), "jawOpen", np.full(60, np.nan)), "values that are not finite"),
        ("a.bvh", "cannot read motion from '.bvh'; use one of .json"),
    ],
)
def test_what_cannot_be_compared(other, words):
    with pytest.raises(InputError, match=words):
        compare(weights("jawOpen"), other)


def test_there_must_be_another():
    with pytest.raises(InputError, match="give another motion file or video"):
        lipmotion.compare(SPEECH)


@pytest.mark.long
@pytest.mark.video
@pytest.mark.recordings
def test_videos_are_tracked(recordings):
    pytest.importorskip("mediapipe")
    clip = min((recordings / "grid-others").glob("*.mpg"))
    (pair,) = compare(clip, clip)["others"]
    assert pair["acc"] == pytest.approx(1)
    assert pair["points"]["points"] == 52
