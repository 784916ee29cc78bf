import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.examples import of_motion, written
from lipmotion.errors import ExportError
from lipmotion.formats.live2d import TOLERANCE, mouth_form, mouth_open
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Span, Timeline, Unit

FRAMES = 300


@pytest.fixture
def talking() -> Generation:
    """Lips that open and close from second 1 on, wider and narrower in turn."""
    time_s = np.arange(FRAMES) / 100
    speaking = time_s >= 1
    opening = 0.01 + 0.15 * speaking * np.sin(2 * np.pi * 2 * time_s) ** 2
    width = 0.6 + 0.08 * speaking * np.sin(2 * np.pi * time_s)
    motion = Motion(np.stack([opening, width], axis=1), 100.0, (Channel("opening"), Channel("width")))
    units = Timeline((Span(0.0, 1.0, Unit("sil")), Span(1.0, 3.0, Unit("aa"))))
    return of_motion(motion, units)


def read(path: Path) -> tuple[dict, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Read as Cubism does: a first point, then segments that begin with their type and hold 1, 3, 1 or 1 points."""
    document = json.loads(path.read_text(encoding="utf-8"))
    points_of = {0: 1, 1: 3, 2: 1, 3: 1}
    curves, segments, points = {}, 0, 0
    for curve in document["Curves"]:
        numbers, at = curve["Segments"], 2
        keys = [(numbers[0], numbers[1])]
        while at < len(numbers):
            count = points_of[numbers[at]]
            keys += [(numbers[at + 1], numbers[at + 2])]
            at += 1 + 2 * count
            segments, points = segments + 1, points + count
        assert at == len(numbers)
        points += 1
        times_s, values = zip(*keys, strict=True)
        curves[curve["Id"]] = (np.array(times_s), np.array(values))
        assert curve["Target"] == "Parameter"
    meta = document["Meta"]
    assert document["Version"] == 3
    assert (meta["CurveCount"], meta["TotalSegmentCount"], meta["TotalPointCount"]) == (len(curves), segments, points)
    assert (meta["UserDataCount"], meta["TotalUserDataSize"]) == (0, 0)
    assert set(meta) >= {"Duration", "Fps", "Loop", "AreBeziersRestricted"}
    return meta, curves


def test_curves_through_the_keys_are_those_of_the_mouth(tmp_path, talking):
    meta, curves = read(written(tmp_path / "a.motion3.json", talking))
    assert meta["Duration"] == pytest.approx(2.99)
    for name, values in (("ParamMouthOpenY", mouth_open(talking)), ("ParamMouthForm", mouth_form(talking))):
        times_s, keys = curves[name]
        assert times_s[0] == 0
        assert times_s[-1] == pytest.approx(2.99)
        assert np.diff(times_s).min() > 0
        assert len(keys) < 0.6 * FRAMES
        assert np.abs(np.interp(talking.motion.time_s, times_s, keys) - values).max() <= TOLERANCE + 5.1e-4


def test_held_poses_change_at_once(tmp_path, talking):
    values = np.repeat([[0.01, 0.6], [0.16, 0.6], [0.01, 0.65]], 100, axis=0)
    steps = replace(talking, motion=replace(talking.motion, values=values), stepped=("opening", "width"))
    paths = [
        written(tmp_path / f"{n}.motion3.json", each) for n, each in enumerate((steps, replace(steps, stepped=())))
    ]
    assert read(paths[0])[1]["ParamMouthOpenY"][0].tolist() == [0, 1, 2, 2.99]
    held, smooth = (json.loads(path.read_text())["Curves"][0]["Segments"][2::3] for path in paths)
    assert (held, set(smooth)) == ([2, 2, 2], {0})


def test_the_mouth_rests_opens_and_is_wide(talking):
    opened, form = mouth_open(talking), mouth_form(talking)
    assert opened[:100].max() < 1e-9
    assert 0.75 < opened.max() < 0.95
    assert np.abs(form[:100]).max() < 1e-9
    assert form.max() > 0.9
    assert -0.7 < form.min() < -0.6


def test_blendshapes_open_it_as_well(tmp_path, talking):
    weights = np.zeros((FRAMES, 3))
    weights[100:, 0], weights[150:, 1], weights[200:, 2] = 0.5, 0.5, 0.8
    names = ("jawOpen", "mouthClose", "mouthPucker")
    motion = Motion(weights, 60.0, tuple(Channel(name, WEIGHT) for name in names))
    moved = replace(talking, motion=motion, spread=weights)
    opened, form = mouth_open(moved), mouth_form(moved)
    assert opened[:100].max() < 1e-9
    assert opened[100:150].min() > 0.3
    assert opened[150:200].max() < 0.05
    assert form[200:].max() < -0.3
    assert read(written(tmp_path / "a.motion3.json", moved))[0]["CurveCount"] == 2


def test_what_does_not_open_is_refused(tmp_path, talking):
    still = replace(talking, motion=Motion(np.zeros((5, 1)), 100.0, (Channel("brow", WEIGHT),)))
    with pytest.raises(ExportError, match="no channel 'opening' or 'jawOpen'"):
        written(tmp_path / "a.motion3.json", still)
    assert not list(tmp_path.iterdir())
