from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lipmotion.types import Motion, Track
from lipmotion_faces.film import background
from lipmotion_faces.film.background import BackgroundSequence, open_stored_background
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.tracking.footage import Footage
from lipmotion_faces.tracking.frames import WHOLE


@pytest.fixture(scope="module")
def sequence(filmed_face: FilmedFace) -> BackgroundSequence:
    return open_stored_background(filmed_face.background)


def without(sequence: BackgroundSequence, unseen: Iterable[int], **more: object) -> BackgroundSequence:
    usable = np.ones(len(sequence.chin_px), bool)
    usable[list(unseen)] = False
    return replace(sequence, usable=usable, **more)  # type: ignore[arg-type]


def shown(sequence: BackgroundSequence, count: int) -> list[int]:
    return [int(number) for number in sequence.order(sequence.groups(), count).first]


@pytest.mark.parametrize("count", [5, 80])
def test_frames_without_a_face_are_not_shown(sequence, count):
    """Also where there are as many frames as are wanted."""
    gap = range(4, 12)
    found = shown(without(sequence, gap), count)
    assert len(found) == count
    assert not set(found) & set(gap)
    assert all(each.has_face for each in without(sequence, gap).frames(count, 25.0))


def test_no_cut_is_shown(sequence):
    found = shown(replace(sequence, cuts=(10,)), 30)
    steps = set(pairwise(found))
    assert not steps & {(9, 10), (10, 9)}


def test_the_video_of_the_speech_keeps_its_time(sequence):
    """Its frames are in order, with gaps and cuts; sound that is a little longer changes nothing."""
    total = len(sequence.chin_px)
    speech = without(sequence, range(10, 20), in_time=True, cuts=(30,))
    assert shown(speech, total) == list(range(total))
    assert shown(speech, total + 2) == [*range(total), total - 1, total - 1]
    seen = [each.has_face for each in speech.frames(total, 25.0)]
    assert [n for n, face in enumerate(seen) if not face] == list(range(10, 20))


def footage(seen: np.ndarray, rate_hz: float = 25.0, cuts: tuple[int, ...] = ()) -> Footage:
    count = len(seen)
    track = Track(Motion(np.zeros((count, 0)), rate_hz, ()), seen)
    maps, times_s = np.zeros((count, 2, 3)), np.arange(count) / rate_hz
    return Footage(None, WHOLE, track, maps, times_s, cuts, (2, 2), rate_hz)  # type: ignore[arg-type]


def test_parts_show_the_face_without_a_cut():
    seen = np.ones(1000, bool)
    seen[100:110] = False  # 0.4 s
    seen[300] = False  # one picture was dropped
    seen[-2:] = False
    parts = [(start, stop) for _, start, stop in background.divide_footage(footage(seen, cuts=(500,)))]
    assert parts == [(0, 100), (110, 305), (305, 500), (500, 749), (749, 998)]


def test_short_parts_are_compared_only_if_there_are_no_others():
    seen = np.ones(400, bool)
    seen[np.r_[50:60, 110:120, 260:270]] = False
    for frames, expected in ((seen, [(120, 260), (270, 400)]), (seen[:170], [(0, 50), (60, 110), (120, 170)])):
        assert [part[1:] for part in background.choose_parts([footage(frames)])] == expected


def test_parts_are_of_one_size():
    """That of most of the footage."""
    small, large = footage(np.ones(100, bool)), replace(footage(np.ones(160, bool)), size=(4, 4))
    assert [part[0] for part in background.choose_parts([small, large, small])] == [small, small]
