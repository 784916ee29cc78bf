import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.testing.toy import toy_motion, toy_sentences
from lipmotion.types import Motion
from lipmotion_faces.appearance.lower_face import CORNER, region_map
from lipmotion_faces.appearance.placing import cut
from testing.toy_face import toy_chin_px, toy_face, toy_footage_pictures, toy_frames, toy_lower_faces, toy_places


@pytest.fixture(scope="module")
def motion() -> Motion:
    whole = toy_motion(toy_sentences(3)[0].units, 25.0)
    return Motion(whole.values[10:40], 25.0, whole.channels)


def test_frames_show_the_lower_faces_where_they_are_placed(motion):
    places = toy_places(len(motion.values))
    drawn = toy_lower_faces(motion, noise=0)
    frames = toy_frames(motion, places, noise=0)
    for frame, place, face in zip(frames, places, drawn, strict=True):
        seen = np.clip(cut(frame, region_map(place, 1), (128, 128)), 0, 255)
        assert np.abs(seen - face).mean() < 1.5


def test_the_mouth_opens_and_the_chin_drops_as_far_as_they_should(motion):
    faces = toy_lower_faces(motion, 2, noise=0).astype(int)
    column = faces[:, :, 134]  # in the middle of a tooth
    inside = ((column < 90).all(axis=2) | (column.min(axis=2) > 190)).sum(axis=1) / 2 / 90
    wide = motion["opening"] > 0.05
    assert inside[wide] == pytest.approx(motion["opening"][wide], abs=0.02)
    skin = column[:, 160:, 0] > 165
    tips = CORNER[1] + (160 + 128 - 32 - skin[:, ::-1].argmax(axis=1)) / 2
    assert tips == pytest.approx(toy_chin_px(motion), abs=1.0)


@pytest.mark.long
def test_the_same_every_time():
    first, again = toy_footage_pictures(3), toy_footage_pictures(3)
    assert all(np.array_equal(one, other) for one, other in zip(first.clips, again.clips, strict=True))
    assert len(first.motion) == len(first.levels_db) == len(first.chin_px) == sum(map(len, first.clips))
    finer = toy_footage_pictures(3, scale=2).finer(np.array([3, 70]))
    assert finer.shape == (2, 256, 256, 3)
    assert np.abs(finer[0, ::2, ::2].astype(int) - first.clips[0][3]).mean() < 3


def test_what_is_refused():
    with pytest.raises(InputError, match="at least 3"):
        toy_face(2)
    with pytest.raises(InputError, match="a background of 0 frames a second, required more than 0"):
        toy_face(rate_hz=0)
