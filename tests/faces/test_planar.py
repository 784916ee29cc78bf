"""Frames for the encoder look like those for people."""

import numpy as np
import pytest

from lipmotion import Staging
from lipmotion.articulation.liveliness import UpperFace
from lipmotion.types import Channel, Motion, Timeline
from lipmotion_faces import base
from lipmotion_faces.base import DrawsPlanes, Face
from lipmotion_faces.portrait.characters import CARTOON, MAN, WOMAN
from lipmotion_faces.portrait.geometry import MouthPose
from lipmotion_faces.portrait.movement import HeadPlacement
from lipmotion_faces.portrait.planar import FROM_RGB, OFFSETS, PlanarRasteriser, planes_of
from lipmotion_faces.portrait.portrait_rasteriser import FacePose, Rasteriser
from lipmotion_faces.registry import stage_face

MOTION = Motion(np.linspace(0, 0.2, 30)[:, None], 25.0, (Channel("opening"),))
POSES = (
    FacePose(MouthPose(gap=0.0)),
    FacePose(MouthPose(gap=0.15, jaw=0.12, tongue=0.5), gaze_x=0.03, brows=0.02, head=HeadPlacement(0.02, 0.01, 0.03)),
    FacePose(MouthPose(gap=0.08, width=0.75, protrusion=1.0), lids=0.6, head=HeadPlacement(yaw=0.03, pitch=-0.02)),
    FacePose(MouthPose(gap=0.044, tuck=1.0)),
    FacePose(MouthPose(gap=0.08, tongue=1.0, jaw=0.03)),
    FacePose(MouthPose(gap=0.04, frown=1.0, upper_raise=1.0), mood=UpperFace(lowered=1.0, squint=0.6, sneer=1.0)),
    FacePose(MouthPose(gap=0.0, smile=1.0), mood=UpperFace(inner=0.8, outer=0.5, wide=1.0, cheek=0.7)),
)


def in_yuv(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return brightness [shape=(H, W)] and the means of colours of four pixels each [shape=(2, H / 2, W / 2)]."""
    values = (picture @ FROM_RGB.T + OFFSETS).transpose(2, 0, 1)
    _, height, width = values.shape
    return values[0], values[1:].reshape(2, height // 2, 2, width // 2, 2).mean(axis=(2, 4))


def decibel(difference: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.square(difference).mean()))


@pytest.mark.parametrize(
    ("design", "background"),
    [(WOMAN, "scene"), (MAN, (40, 160, 255)), (CARTOON, "scene")],
    ids=["woman", "man", "cartoon"],
)
def test_planes_are_those_of_the_picture(design, background):
    pictures, planes = Rasteriser(design, 160, background), PlanarRasteriser(design, 160, background)
    canvas, planar_canvas = pictures.canvas(), planes.canvas()
    for pose in POSES:
        luma, colours = in_yuv(pictures.picture(pose, canvas))
        brightness, *shown = planes_of(planes.picture(pose, planar_canvas))
        assert decibel(luma - brightness) > 50
        assert decibel(colours - np.array(shown)) > 45
        assert np.abs(luma - brightness).max() < 16  # a line that is off by a pixel would be


def test_a_frame_does_not_depend_on_the_ones_before():
    drawing = PlanarRasteriser(WOMAN, 96)
    used = drawing.canvas()
    for pose in (*POSES, *POSES[::-1]):
        assert np.array_equal(drawing.picture(pose, used), drawing.picture(pose, drawing.canvas()))


def test_all_even_sizes_have_planes():
    for size in (64, 66):
        drawing = PlanarRasteriser(MAN, size)
        frame = drawing.picture(POSES[0], drawing.canvas())
        assert frame.shape == (size * 3 // 2, size)
        assert [plane.shape for plane in planes_of(frame)] == [(size, size), *[(size // 2, size // 2)] * 2]


def test_a_transparent_face_has_no_planes():
    face = stage_face("woman", Staging(background=base.TRANSPARENT))
    assert isinstance(face, DrawsPlanes)
    assert face.render_planes(MOTION, Timeline(())) is None


def test_there_are_as_many_planes_as_pictures():
    face = stage_face("man", Staging(size=64))
    assert isinstance(face, DrawsPlanes)
    assert isinstance(face, Face)
    planes = face.render_planes(MOTION, Timeline(()), fps=20)
    assert planes is not None
    assert len(list(planes)) == len(list(face.render(MOTION, Timeline(()), fps=20)))
