import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.faces.portrait import render
from lipmotion.faces.portrait.geometry import LINE_Y
from lipmotion.faces.portrait.view import View
from lipmotion.types import Channel, Motion, Span, Timeline, Unit

NOTHING_SAID: Timeline[Unit] = Timeline(())


def opening(*values: float, rate_hz: float = 25.0) -> Motion:
    return Motion(np.array(values)[:, None], rate_hz, (Channel("opening"),))


def hole(frame: np.ndarray) -> int:
    """Return the number of pixels between the lips that are as dark as the inside of a mouth."""
    area = View(len(frame)).window(-0.25, 0.75, 0.25, 1.3).area
    return int((frame[area].sum(axis=2) < 150).sum())


@pytest.mark.parametrize("height", [64, 130, 360])
def test_frames_are_square_rgb_of_the_height_asked(height):
    frames = list(render(opening(0, 0.2), NOTHING_SAID, height=height))
    assert [frame.shape for frame in frames] == [(height, height, 3)] * 2
    assert all(frame.dtype == np.uint8 for frame in frames)


def test_the_number_of_frames_follows_the_frame_rate():
    moved = opening(*np.zeros(101), rate_hz=100.0)
    assert [sum(1 for _ in render(moved, NOTHING_SAID, fps=fps, height=64)) for fps in (25, 30, 60)] == [26, 31, 61]


def test_the_same_input_gives_the_same_pixels():
    first, second = (list(render(opening(0, 0.1, 0.3), NOTHING_SAID, height=128)) for _ in range(2))
    assert np.array_equal(first, second)


def test_the_mouth_is_dark_inside_only_when_open():
    closed, small, wide = render(opening(0, 0.08, 0.3), NOTHING_SAID, height=360)
    assert hole(closed) == 0
    assert 0 < hole(small) < hole(wide)


def test_only_mouth_and_jaw_move_with_the_mouth():
    closed, wide = render(opening(0, 0.3), NOTHING_SAID, height=360)
    rows = np.flatnonzero((closed != wide).any(axis=(1, 2)))
    view = View(360)
    y = (rows - view.origin[1]) / view.scale
    assert 0.6 < y.min() < 0.8
    assert 1.6 < y.max() < 2.0


def test_the_chin_drops_in_one_piece():
    """Down the middle below the lips: skin, the edge of the chin, shaded neck; the edge moves by the jaw's drop."""

    def chin_y(frame: np.ndarray) -> float:
        view = View(len(frame))
        column = frame[:, len(frame) // 2].astype(float).sum(axis=1)
        first = int(view.origin[1] + 1.3 * view.scale)
        steps = column[first + 3 : -30] - column[first:-33]
        return (first + int(np.argmin(steps)) - view.origin[1]) / view.scale

    closed, wide = render(opening(0, 0.3), NOTHING_SAID, height=640)
    assert chin_y(closed) == pytest.approx(1.39, abs=0.03)
    assert 0.15 < chin_y(wide) - chin_y(closed) < 0.3


def test_f_shows_teeth_where_closed_lips_show_none():
    labels = Timeline((Span(0.0, 0.4, Unit("f")), Span(0.4, 0.8, Unit("m"))))
    frames = list(render(opening(*np.zeros(21)), labels, height=360))
    view = View(360)
    area = view.window(-0.05, LINE_Y - 0.03, 0.05, LINE_Y + 0.05).area

    def brightest(frame: np.ndarray) -> float:
        return float(frame[area].min(axis=2).max())

    assert brightest(frames[5]) > brightest(frames[15]) + 25


def test_eyes_blink():
    frames = np.array(list(render(opening(*np.zeros(75)), NOTHING_SAID, height=128)))
    changing = (frames != frames[0]).any(axis=(1, 2, 3))
    assert 2 <= changing.sum() <= 8
    rows = np.flatnonzero((frames != frames[0]).any(axis=(0, 2, 3)))
    view = View(128)
    assert view.origin[1] - 0.25 * view.scale < rows.min() < rows.max() < view.origin[1] + 0.2 * view.scale


@pytest.mark.parametrize("height", [0, 62, 129])
def test_an_unusable_height_is_refused_at_once(height):
    with pytest.raises(InputError, match="even number of at least 64"):
        render(opening(0), NOTHING_SAID, height=height)


def test_an_unusable_motion_is_refused_at_once():
    with pytest.raises(InputError, match="no channel 'opening'"):
        render(Motion(np.zeros((3, 1)), 25.0, (Channel("width"),)), NOTHING_SAID)
