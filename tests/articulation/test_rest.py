import numpy as np
import pytest

from lipmotion.articulation.rest import LARGEST_REST, find_rest_frames, measure_at_rest
from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Span, Timeline, Unit

SILENCE = Timeline((Span(0.0, 0.2, Unit("sil")), Span(0.2, 1.0, Unit("aa"))))


def motion(opening: list[float], name: str = "opening") -> Motion:
    return Motion(np.array(opening)[:, None], 10.0, (Channel(name),))


def test_silence_is_rest():
    assert np.flatnonzero(find_rest_frames(motion([0.01] * 2 + [0.1] * 9), SILENCE)).tolist() == [0, 1]


def test_open_silence_is_speech_and_the_most_closed_frames_are_rest():
    opening = [LARGEST_REST + 0.02] * 2 + [0.1] * 8 + [0.0]
    assert np.flatnonzero(find_rest_frames(motion(opening), SILENCE)).tolist() == [10]
    assert np.flatnonzero(find_rest_frames(motion(opening), Timeline(()))).tolist() == [10]


def test_where_no_opening_is_known_silence_counts_or_else_everything():
    weights = motion([0.0] * 11, "jawOpen")
    assert np.flatnonzero(find_rest_frames(weights, SILENCE)).tolist() == [0, 1]
    assert find_rest_frames(weights, Timeline(())).all()
    opening = np.array([0.1] * 10 + [0.0])
    assert np.flatnonzero(find_rest_frames(weights, Timeline(()), opening)).tolist() == [10]


def test_sizes_at_rest_are_positive():
    rest = np.array([True, False])
    assert measure_at_rest("width", np.array([0.5, 0.6]), rest) == pytest.approx(0.5)
    with pytest.raises(InputError, match="the width is 0 at rest, required more than 0"):
        measure_at_rest("width", np.array([0.0, 0.6]), rest)
