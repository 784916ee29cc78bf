from typing import Any

import numpy as np
import pytest

from lipmotion.articulation.liveliness import UpperFace
from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion_faces import FACES, Staging, stage_face, testing
from lipmotion_faces.portrait import characters, layer
from lipmotion_faces.portrait.geometry import NECK_END, NECK_TOP, PIVOT_Y, HeadField, HeadPlacement, MouthPose, grid
from lipmotion_faces.portrait.portrait_rasteriser import FacePose, Rasteriser

NOTHING_SAID: Timeline[Unit] = Timeline(())
DRAWN = ("woman", "man", "cartoon")
STILL = {"blinks": False, "gaze": False, "brows": False, "head": False}
LINE_Y = characters.WOMAN.lips.line_y


def opening(*values: float, rate_hz: float = 25.0) -> Motion:
    return Motion(np.array(values)[:, None], rate_hz, (Channel("opening"),))


def frames(motion, units=NOTHING_SAID, face="woman", fps=25.0, **staging):
    return list(stage_face(face, Staging(**staging)).render(motion, units, fps=fps))


def hole(frame: np.ndarray) -> int:
    """Return the number of pixels between the lips that are as dark as the inside of a mouth."""
    area = layer.View(len(frame)).window(-0.25, 0.75, 0.25, 1.3).area
    return int((frame[area].sum(axis=2) < 200).sum())


@pytest.mark.parametrize("name", [name for name in FACES.names if name in (*DRAWN, "portrait")])
def test_characters_keep_the_contract(name):
    testing.check_face(stage_face(name, Staging(size=96)))


def test_the_number_of_frames_follows_the_frame_rate():
    moved = opening(*np.zeros(101), rate_hz=100.0)
    assert [len(frames(moved, fps=fps, size=64)) for fps in (12, 23.976, 25, 30, 60)] == [13, 24, 26, 31, 61]


@pytest.mark.parametrize("face", DRAWN)
def test_the_mouth_is_dark_inside_only_when_open_and_only_mouth_and_jaw_move_with_it(face):
    closed, small, wide = frames(opening(0, 0.08, 0.3), face=face, size=360, **STILL)
    assert 1.5 * hole(closed) < hole(small) < hole(wide)
    assert face == "cartoon" or hole(closed) < 10  # the cartoon's lips meet in a dark line
    rows = np.flatnonzero((np.abs(closed.astype(int) - wide) > 2).any(axis=(1, 2)))
    view = layer.View(360)
    y = (rows - view.origin[1]) / view.scale
    assert 0.35 < y.min() < 0.8
    assert 1.4 < y.max() < 2.0


def test_the_chin_drops_in_one_piece():
    """Down the middle below the lips: skin, the edge of the chin, shaded neck; the edge moves by the jaw's drop."""

    def chin_y(frame: np.ndarray) -> float:
        view = layer.View(len(frame))
        column = frame[:, len(frame) // 2].astype(float).sum(axis=1)
        first = int(view.origin[1] + 1.3 * view.scale)
        steps = column[first + 3 : -30] - column[first:-33]
        return (first + int(np.argmin(steps)) - view.origin[1]) / view.scale

    closed, wide = frames(opening(0, 0.2), size=640, **STILL)
    assert chin_y(closed) == pytest.approx(1.39, abs=0.03)
    assert 0.12 < chin_y(wide) - chin_y(closed) < 0.3


def test_f_shows_teeth_where_closed_lips_show_none():
    labels = Timeline((Span(0.0, 0.4, Unit("f")), Span(0.4, 0.8, Unit("m"))))
    drawn = frames(opening(*np.zeros(21)), labels, size=360, **STILL)
    area = layer.View(360).window(-0.05, LINE_Y - 0.03, 0.05, LINE_Y + 0.05).area

    def brightest(frame: np.ndarray) -> float:
        return float(frame[area].min(axis=2).max())

    assert brightest(drawn[5]) > brightest(drawn[15]) + 60


def test_teeth_that_are_hardly_seen_are_covered_but_not_grey() -> None:
    """Down the middle there are pixels of dark and of teeth, and hardly any between the two but in the lip's shadow."""
    size = 1200
    drawer = Rasteriser(characters.WOMAN, size)
    canvas, area = drawer.canvas(), layer.View(size).window(-0.004, LINE_Y - 0.06, 0.004, LINE_Y + 0.12).area
    for gap, teeth in ((0.06, 0.2), (0.06, 0.25), (0.09, 0.05), (0.09, 0.1)):
        column = drawer.picture(FacePose(MouthPose(gap, teeth=teeth)), canvas)[area].astype(float).mean(axis=1)
        grey = (np.ptp(column, axis=1) < 45) & (column.max(axis=1) > 80) & (column.max(axis=1) < 190)
        assert grey.sum() <= 5


def test_eyes_blink_and_nothing_else_moves():
    drawn = np.array(frames(opening(*np.zeros(250)), size=96, **{**STILL, "blinks": True}))
    changing = (drawn != drawn[0]).any(axis=(1, 2, 3))
    assert 4 <= changing.sum() <= 60
    rows = np.flatnonzero((drawn != drawn[0]).any(axis=(0, 2, 3)))
    view = layer.View(96)
    assert view.origin[1] - 0.25 * view.scale < rows.min() < rows.max() < view.origin[1] + 0.25 * view.scale


def test_each_part_moves_where_it_is_on_and_nothing_where_all_is_still():
    drawn = frames(opening(*np.zeros(50)), size=96, **STILL)
    assert all(np.array_equal(frame, drawn[0]) for frame in drawn)
    for part in ("gaze", "brows", "head"):
        drawn = frames(opening(*np.tile([0.0, 0.2], 40)), size=64, **{**STILL, part: True})
        assert any(np.any(frame != drawn[0]) for frame in drawn[2::2])


@pytest.mark.parametrize("face", DRAWN)
def test_a_transparent_background_shows_through_around_the_figure_only(face):
    (frame,) = frames(opening(0), face=face, size=128, background="transparent")
    assert frame.shape == (128, 128, 4)
    assert frame[0, 0, 3] == frame[0, -1, 3] == 0
    assert frame[64, 64, 3] == 255
    assert 0.2 < (frame[..., 3] == 0).mean() < 0.7
    (red,) = frames(opening(0), face=face, size=128, background="#ff0000")
    cover = frame[..., 3:] / 255
    over = frame[..., :3] * cover + np.array([255, 0, 0]) * (1 - cover)
    assert np.abs(over - red).max() < 4
    assert red[0, 0].tolist() == [255, 0, 0]


def test_unusable_settings_and_motions_are_refused():
    unusable: dict[str, tuple[Any, ...]] = {"size": (62, 129, 5000), "background": ("blue", "#12345")}
    for name, values in unusable.items():
        for value in values:
            with pytest.raises(InputError, match="required"):
                Staging(**{name: value})
    with pytest.raises(InputError, match="no channel 'opening'"):
        stage_face("woman", Staging()).render(Motion(np.zeros((3, 1)), 25.0, (Channel("width"),)), NOTHING_SAID)


def test_columns_and_rows_are_those_of_the_pixel_centres():
    view = layer.View(80)
    whole = view.window(-9, -9, 9, 9)
    for columns in (whole.columns(), whole.columns(4)):
        assert columns == pytest.approx(-columns[::-1], abs=1e-6)  # the point between the eyes is in the middle
    assert np.diff(whole.columns()) == pytest.approx(1 / view.scale, rel=1e-4)
    assert whole.rows()[32] == pytest.approx(0.5 / view.scale)
    part = view.window(-0.5, 0.2, 0.5, 0.6)
    assert part.columns() == pytest.approx(whole.columns()[part.x0 : part.x1])


def test_a_head_that_rolls_is_turned_about_its_neck():
    """Each place moves at right angles to its distance from the pivot, and clockwise; below the neck nothing moves."""
    window = layer.View(160).window(-9, -9, 9, 9)
    x, y = grid(window)
    right, down = HeadField(window).shifts(HeadPlacement(roll=0.1))
    head = y < NECK_TOP
    assert (right * x + down * (y - PIVOT_Y))[head] == pytest.approx(0, abs=1e-9)
    assert right[head].max() < 0  # what is shown at the top comes from the left
    assert not right[y > NECK_END].any()


POSES = (
    FacePose(MouthPose(gap=0.0)),
    FacePose(MouthPose(gap=0.15, jaw=0.12, tongue=0.5), gaze_x=0.03, brows=0.02, head=HeadPlacement(0.02, 0.01, 0.03)),
    FacePose(MouthPose(gap=0.08, width=0.75, protrusion=1.0), lids=0.6, head=HeadPlacement(yaw=0.03, pitch=-0.02)),
    FacePose(MouthPose(gap=0.044, tuck=1.0)),
    FacePose(MouthPose(gap=0.08, tongue=1.0, jaw=0.03)),
    FacePose(MouthPose(gap=0.04, frown=1.0, upper_raise=1.0), mood=UpperFace(lowered=1.0, squint=0.6, sneer=1.0)),
    FacePose(MouthPose(gap=0.0, smile=1.0), mood=UpperFace(inner=0.8, outer=0.5, wide=1.0, cheek=0.7)),
)


def test_a_frame_does_not_depend_on_the_ones_before():
    drawing = Rasteriser(characters.WOMAN, 96)
    used = drawing.canvas()
    for pose in (*POSES, *POSES[::-1]):
        assert np.array_equal(drawing.picture(pose, used), drawing.picture(pose, drawing.canvas()))
