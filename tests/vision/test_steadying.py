from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion.types import Motion, Track
from lipmotion_faces.tracking import steadying
from lipmotion_faces.tracking.frames import WHOLE
from lipmotion_faces.tracking.steadying import REGISTERED_NOISE_PX, register_maps, steady_maps
from lipmotion_faces.tracking.track import Footage

STILL = np.array([[0.8, 0, 100], [0, 0.8, 60]])
MOUTH = np.array([0.0, 76.0, 1.0])
RATE_HZ = 25.0


def at(places) -> np.ndarray:
    """Maps of a face at some places, px [shape=(T, 2, 3)]."""
    maps = np.repeat(STILL[None], len(places), axis=0)
    maps[:, :, 2] += places
    return maps


def trembling(size: float, count: int = 60) -> np.ndarray:
    return np.random.default_rng(3).normal(scale=size, size=(count, 2))


def spread(maps) -> float:
    return float(np.sqrt(np.square(np.diff(maps @ MOUTH, axis=0)).sum(axis=1).mean()))


def test_small_trembling_is_taken_away():
    maps = at(trembling(0.15))
    maps[:, :, :2] += np.random.default_rng(4).normal(scale=0.002, size=(60, 2, 2))
    assert spread(steady_maps(maps, RATE_HZ)) < 0.5 * spread(maps)


def test_a_quick_nod_stays():
    nod = np.zeros((60, 2))
    nod[30:36, 1] = [3, 9, 14, 14, 9, 3]
    moved = (steady_maps(at(nod), RATE_HZ) @ MOUTH)[:, 1]
    true = (at(nod) @ MOUTH)[:, 1]
    assert np.abs(moved - true).max() < 0.25
    assert np.abs(moved[[20, 45]] - true[[20, 45]]).max() < 0.01


def test_less_is_taken_away_where_less_is_noise():
    maps = at(trembling(0.3))
    tracked, registered = steady_maps(maps, RATE_HZ), steady_maps(maps, RATE_HZ, noise_px=REGISTERED_NOISE_PX)
    assert spread(tracked) < 0.8 * spread(registered) < 0.95 * spread(maps)


def test_a_face_that_moves_evenly_is_not_held_back():
    places = np.arange(60)[:, None] * np.array([1.5, 0.5])
    np.testing.assert_allclose(steady_maps(at(places), RATE_HZ)[4:-4], at(places)[4:-4], atol=1e-6)
    for count in (1, 2):  # a few frames suffice
        still = at(np.zeros((count, 2)))
        np.testing.assert_allclose(steady_maps(still, RATE_HZ), still, atol=1e-9)


def test_nothing_runs_over_a_cut():
    places = np.concatenate([trembling(0.1, 30), 50 + trembling(0.1, 30)])
    together = steady_maps(at(places), RATE_HZ, cuts=(30,))
    apart = [steady_maps(at(part), RATE_HZ) for part in (places[:30], places[30:])]
    np.testing.assert_array_equal(together, np.concatenate(apart))


class TestRegistration:
    """A textured picture that moves by known fractions of a pixel, under maps that tremble."""

    @pytest.fixture(autouse=True)
    def _packages(self):
        pytest.importorskip("cv2")

    @pytest.fixture
    def scene(self, monkeypatch):
        from cv2 import GaussianBlur
        from scipy.ndimage import shift

        def make(places, tremble, cuts=(), seen=None) -> Footage:
            texture = GaussianBlur(np.random.default_rng(1).uniform(0, 255, (120, 170)), (0, 0), 2.0)
            texture = 128 + 4 * (texture - texture.mean())
            frames = [
                np.repeat(
                    np.clip(shift(texture, place[::-1], mode="reflect"), 0, 255).astype(np.uint8)[..., None], 3, 2
                )
                for place in places
            ]
            monkeypatch.setattr(steadying, "footage_frames", lambda _footage: iter(frames))
            count = len(places)
            shown = np.ones(count, bool) if seen is None else seen
            track = Track(Motion(np.zeros((count, 0)), RATE_HZ, ()), shown)
            times_s = np.arange(count) / RATE_HZ
            maps = at(np.asarray(places) + tremble)
            return Footage(Path("scene"), WHOLE, track, maps, times_s, tuple(cuts), (120, 170), RATE_HZ)

        return make

    def test_trembling_of_the_tracker_is_corrected(self, scene):
        places = np.stack([3 * np.sin(np.arange(30) / 5), 2 * np.cos(np.arange(30) / 7)], axis=1)
        footage = scene(places, trembling(0.4, 30))
        wrong, right = (maps[:, :, 2] - at(places)[:, :, 2] for maps in (footage.face_to_image, register_maps(footage)))
        before, after = (np.sqrt(np.square(np.diff(error, axis=0)).mean()) for error in (wrong, right))
        assert before > 0.4
        assert after < 0.15 * before

    def test_steps_over_a_cut_and_of_unseen_frames_are_left_out(self, scene):
        places = np.zeros((30, 2))
        places[15:] = 6
        wrong = np.where(np.arange(30)[:, None] < 15, 0.0, -6.0)  # the tracker has not noticed that the face moved
        seen = np.ones(30, bool)
        noticed = register_maps(scene(places, wrong))
        assert np.abs(noticed - scene(places, wrong).face_to_image).max() > 2
        for footage in (
            scene(places, wrong, cuts=(15,)),
            replace(scene(places, wrong, seen=seen & (places[:, 0] < 1))),
        ):
            np.testing.assert_allclose(register_maps(footage), footage.face_to_image, atol=0.05)

    def test_what_an_unseen_frame_shows_moves_nothing(self, scene):
        """Somebody walks by, and the tracker's places are interpolated."""
        places, seen = np.zeros((30, 2)), np.ones(30, bool)
        places[12:17], seen[12:17] = 6, False
        footage = scene(places, -places, seen=seen)
        np.testing.assert_allclose(register_maps(footage), footage.face_to_image, atol=0.05)

    def test_a_region_without_texture_stays(self, scene, monkeypatch):
        footage = scene(np.zeros((5, 2)), 0.0)
        monkeypatch.setattr(steadying, "footage_frames", lambda _: iter([np.full((120, 170, 3), 90, np.uint8)] * 5))
        with np.errstate(invalid="raise"):
            np.testing.assert_array_equal(register_maps(footage), footage.face_to_image)
