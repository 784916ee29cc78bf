from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion_faces.appearance.looping import describe_frames, row_distances

MAP = np.array([[0.7, 0, 80.0], [0, 0.7, 60.0]])


def scene(count: int = 4) -> np.ndarray:
    """One smooth picture, again and again [shape=(T, 144, 160, 3)]."""
    y, x = np.mgrid[:144, :160]
    picture = 120 + 50 * np.sin(x / 11) * np.cos(y / 13) + x / 8
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[None, :, :, None], count, axis=0).repeat(3, axis=3)


def maps(moves) -> np.ndarray:
    result = np.repeat(MAP[None], len(moves), axis=0)
    result[:, :, 2] += moves
    return result


def test_equal_frames_have_no_distance():
    descriptors = describe_frames(scene(), maps(np.zeros((4, 2))))
    assert len(descriptors) == 4
    assert row_distances(descriptors.standardised([(0, 4)])).max() < 1e-5


def test_the_mouth_does_not_count():
    frames = scene()
    frames[2, 95:130, 60:100] = 0  # below the nose
    same = describe_frames(frames, maps(np.zeros((4, 2))))
    assert row_distances(same.standardised([(0, 4)]))[2].max() < 1e-5
    frames[2, 50:66, 50:110] = 0  # the eyes
    other = describe_frames(frames, maps(np.zeros((4, 2))))
    assert row_distances(other.standardised([(0, 4)]))[2, 0] > 0.5


def test_the_aligned_face_does_not_move():
    still = scene(3)
    moved = np.stack([np.roll(frame, (3 * n, 4 * n), axis=(0, 1)) for n, frame in enumerate(still)])
    descriptors = describe_frames(moved, maps([(4 * n, 3 * n) for n in range(3)]))
    change = np.abs(np.diff(descriptors.eyes, axis=0)).mean()
    unaligned = describe_frames(moved, maps(np.zeros((3, 2))))
    assert change < 0.3 * np.abs(np.diff(unaligned.eyes, axis=0)).mean()
    np.testing.assert_allclose(np.diff(descriptors.place, axis=0), np.tile([4, 4, 4, 3, 3, 3], (2, 1)))


def test_neighbours_differ_by_about_one():
    frames = scene(30)
    noisy = np.clip(frames + np.random.default_rng(0).normal(scale=20, size=frames.shape), 0, 255).astype(np.uint8)
    moves = np.cumsum(np.random.default_rng(1).normal(size=(30, 2)), axis=0)
    distances = row_distances(describe_frames(noisy, maps(moves)).standardised([(0, 30)]))
    assert 0.7 < np.median(np.diag(distances, 1)) < 1.4
    np.testing.assert_allclose(np.diag(distances), 0, atol=1e-5)


def test_any_size():
    for size in ((20, 30), (1, 1)):
        frames = np.zeros((2, *size, 3), np.uint8)
        assert np.isfinite(describe_frames(frames, maps(np.zeros((2, 2)))).standardised([(0, 2)])).all()


def test_other_frames_than_maps_are_refused():
    for frames in (scene(3), scene(5), [], [scene(1)[0], *scene(3)[:, :100]]):
        with pytest.raises(InputError, match="required as many"):
            describe_frames(frames, maps(np.zeros((4, 2))))
