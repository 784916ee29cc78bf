from typing import Any

import numpy as np
import pytest

from faces.head.motions import NOTHING_SAID, opening, parts_seen
from lipmotion import Staging, errors
from lipmotion_faces import head, make_face, testing
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.stage import Stage, camera_for
from lipmotion_faces.rendering.drawn_surface import Camera


def test_the_head_is_a_face_like_all_others_and_an_unusable_size_is_refused_at_once():
    testing.check_face(make_face("head"))
    for size in ((63, 120), (160, 0), (129, 120)):
        with pytest.raises(errors.InputError, match="even number of at least 64"):
            head.Head(size=size).render(opening(0), NOTHING_SAID)


@pytest.fixture(scope="module")
def front() -> Stage:
    return Stage(Camera(240, 200, (0.0, -0.68), 0.8))


def areas(stage: Stage, **pose: Any) -> dict[str, int]:
    return {name: int(mask.sum()) for name, mask in parts_seen(stage, CharacterPose(**pose)).items()}


def test_closed_lips_show_nothing_of_the_mouth(front):
    for pose in ({}, {"press": 1.0}, {"roundness": 1.0, "width": 0.7, "protrusion": 0.085}):
        seen = areas(front, **pose)
        assert seen.pop("lips") > 800
        assert seen == {"wall": 0, "tongue": 0, "teeth": 0, "upper teeth": 0}


def test_the_mouth_does_not_come_through_the_skin_above_protruded_lips():
    close = Stage(Camera(300, 220, (0.0, -0.71), 0.6))
    for gap in (0.0, 0.004, 0.008):
        pose = CharacterPose(gap=gap, upper_rise=0.48 * gap, width=0.82, roundness=1.0, protrusion=0.1)
        skin = close.picture(pose._replace(jaw=0.4 * gap, fullness=1.08))[50:75, 140:160].astype(int).sum(axis=2)
        assert skin.min() > np.median(skin) - 120


def test_a_picture_of_the_moving_part_is_the_whole_picture():
    stage, pose = Stage(camera_for(320, 240)), CharacterPose(gap=0.1, turn=(0.2, 0.05, 0.0))
    drawn = stage.figure.frame(pose, stage.canvas.camera.place)
    whole = stage.canvas.picture(drawn.places, drawn.light, stage.figure.triangles)
    assert np.array_equal(stage.picture(pose), whole)


def first(motion=None, **settings: Any) -> np.ndarray:
    face = head.Head(Staging(size=120, **settings))
    return next(iter(face.render(opening(*[0.1] * 5) if motion is None else motion, NOTHING_SAID)))


def test_a_transparent_picture_over_a_colour_is_the_picture_on_that_colour():
    clear, on_grey = first(background="transparent").astype(float), first(background="#808080").astype(float)
    alpha = clear[..., 3:] / 255
    over = alpha * clear[..., :3] + (1 - alpha) * 128
    whole = (alpha[..., 0] == 0) | (alpha[..., 0] == 1)
    assert np.abs(over - on_grey)[whole].max() <= 1
    assert np.abs(over - on_grey).max() < 40  # edges are mixed as light, not as grey levels
    assert 0.2 < (alpha == 0).mean() < 0.9


@pytest.mark.long
def test_what_is_switched_off_does_not_move():
    moved = opening(*[0.0] * 60)
    still = Staging(size=64, blinks=False, gaze=False, brows=False, head=False)
    frames = list(head.Head(still).render(moved, NOTHING_SAID))
    assert all(np.array_equal(frame, frames[0]) for frame in frames[1:])
    lively = list(head.Head().with_staging(Staging(size=64)).render(moved, NOTHING_SAID))
    assert not np.array_equal(lively[0], lively[30])
