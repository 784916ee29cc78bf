from __future__ import annotations

import numpy as np
import pytest

from lipmotion.storage.frame_groups import FrameGroups

STARTS = [0, 4, 8, 12, 16, 18]


class Film:
    """Frames that know their number, and how often they were read."""

    def __init__(self) -> None:
        self.read: list[tuple[int, int]] = []

    def frames(self, start: int, stop: int) -> list[np.ndarray]:
        self.read.append((start, stop))
        return [np.full((10, 10, 3), n % 256, np.uint8) for n in range(start, stop)]


@pytest.mark.parametrize(
    "order", [range(18), range(17, -1, -1), [5, 17, 0, 5, 6, 16, 4], [*range(18), *range(16, 0, -1)]]
)
@pytest.mark.parametrize("most_bytes", [0, 3 * 4 * 300, 10**6])
def test_every_frame_is_the_right_one(order, most_bytes):
    groups = FrameGroups(Film().frames, STARTS, most_bytes)
    assert [int(groups.frame(n)[0, 0, 0]) for n in order] == list(order)


def test_frames_are_read_once_each_way():
    film = Film()
    groups = FrameGroups(film.frames, STARTS, 0)
    for n in [*range(18), *range(16, -1, -1)]:
        groups.frame(n)
    ways = [(0, 4), (4, 8), (8, 12), (12, 16), (16, 18)]
    assert film.read == [*ways, *ways[2::-1]]  # the last two were still there


def test_memory_is_bounded():
    film = Film()
    groups = FrameGroups(film.frames, range(0, 401, 4), most_bytes=3 * 4 * 300)
    most = 0
    for n in range(400):
        groups.frame(n)
        most = max(most, groups.nbytes)
    assert most == 3 * 4 * 300


def test_other_frames_are_refused():
    for index in (-1, 18, 100):
        groups = FrameGroups(Film().frames, STARTS)
        assert len(groups) == 18
        with pytest.raises(IndexError, match=rf"frame {index} of 18"):
            groups.frame(index)
