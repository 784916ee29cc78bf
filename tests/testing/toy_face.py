"""A toy face: the face of a drawn person whose mouth, jaw and head follow known motion, learned as footage is.

It shows nobody, it needs neither OpenCV nor MediaPipe, and where everything is in every picture is known.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.eigenlips import EYE_DISTANCE_PX, MOUTH_CORNER, MOUTH_HEIGHT
from lipmotion.speech.sound.pauses import STEP_S, measure_levels_db
from lipmotion.types import Audio, Motion
from lipmotion_faces.appearance.lower_face import CORNER, HEIGHT, WIDTH, FaceShape
from lipmotion_faces.appearance.person import FootagePictures, learn_appearance
from lipmotion_faces.appearance.placing import invert_map
from lipmotion_faces.coded_video import encode_video
from lipmotion_faces.filmed.face import FilmedFace, SpokenTake, StoredBackground
from testing.toy import CAMERA_HZ, INNER_WIDTH, INSIDE, LIPS, SKIN, ToySentence, toy_motion, toy_sentences

Array = NDArray[np.float64]
Values = NDArray[np.floating[Any]]
Pictures = NDArray[np.uint8]

SHAPE = FaceShape(44.0, 109.0)  # the part of the lower face that is replaced: it ends above the chin at its highest
CHIN_PX, CHIN_DROP_PX = 113.0, 40.0
"""How far the tip of the chin is below the eyes when the mouth is closed, and how much further for an opening of 1."""
FRAME_WIDTH, FRAME_HEIGHT = 224, 288  # size of a frame of the background, px
SCALE = 0.9  # size of the face in the background: px of the frame for one px of the face
MIDDLE_PX = (112.0, 120.0)  # where the point between the eyes is in the frame, on average, px
SWAY_PX, SWAY_S = 3.0, 4.0  # the head moves so far to either side, in so long a time
TILT = 0.02  # the head tilts so far to either side, radians
BACKGROUND_S = 2.0
HEAD_PX = (66.0, 80.0)  # half width of the head, and its height above ``HEAD_MIDDLE_PX``, px of the face
HEAD_MIDDLE_PX = 17.0  # height at which the head is widest, px below the eyes
CREASE_PX, CREASE = (4.0, 18.0), 0.2
"""Height and width of the crease above the chin, px of the face, and how much darker it is."""
MIN_OPENING_PX, TEETH_PX = 0.6, 5.0  # a mouth that is open less looks closed; height of the upper teeth, px of the face
NECK_PX = 40.0  # half width of the neck, px of the face
TEETH, NECK, WALL, EYES = (226.0, 220.0, 205.0), (150.0, 112.0, 98.0), (70.0, 96.0, 120.0), (40.0, 34.0, 38.0)
"""Colours, RGB."""
NOISE = 1.2  # standard deviation of the noise of the camera, grey levels


def toy_lower_faces(motion: Motion, *, noise: float = NOISE, seed: int = 0) -> Pictures:
    """Return pictures of the lower face [shape=(T, 128, 128, 3)] of the toy motion, uint8.

    motion : ``opening``, ``width`` and ``outer``, of ``toy_motion``
    noise  : standard deviation of the noise, grey levels
    """
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    x, y, draw = columns + 0.5 + CORNER[0], rows + 0.5 + CORNER[1], np.random.default_rng(seed)
    return np.stack([_picture(x, y, shape, 1, noise, draw) for shape in _shapes(motion)])


def toy_chin_px(motion: Motion) -> Array:
    """Return how far the tip of the toy's chin is below its eyes, px of the face [shape=(T,)]."""
    return CHIN_PX + CHIN_DROP_PX * np.asarray(motion["opening"], np.float64)


def toy_places(frames: int, rate_hz: float = CAMERA_HZ) -> Array:
    """Return where the toy's face is in the frames of its background: maps from px of the face [shape=(T, 2, 3)]."""
    phase = 2 * np.pi * np.arange(frames) / rate_hz / SWAY_S
    angle = TILT * np.sin(phase + 1)
    turn = SCALE * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = np.array(MIDDLE_PX)[:, None] + SWAY_PX * np.array([np.sin(phase), 0.5 * np.cos(phase)])
    return np.concatenate([turn, middle[:, None]], axis=1).transpose(2, 0, 1)


def toy_frames(motion: Motion, places: Array, *, noise: float = NOISE, seed: int = 0) -> Iterator[Pictures]:
    """Yield frames of the toy person, each uint8 [shape=(288, 224, 3)].

    motion : ``opening``, ``width`` and ``outer``, T frames
    places : of the face in them, of ``toy_places`` [shape=(T, 2, 3)]
    """
    rows, columns = np.mgrid[:FRAME_HEIGHT, :FRAME_WIDTH]
    centres = np.stack([columns + 0.5, rows + 0.5, np.ones(rows.shape)], axis=-1)
    draw = np.random.default_rng(seed)
    for shape, place in zip(_shapes(motion), places, strict=True):
        position = centres @ invert_map(place).T
        yield _picture(position[..., 0], position[..., 1], shape, 1 / SCALE, noise, draw)


def toy_face(sentences: int = 4) -> FilmedFace:
    """Return the face of the toy person, learned from toy sentences in a second or two."""
    spoken = toy_sentences(sentences)
    count = round(BACKGROUND_S * CAMERA_HZ)
    moved = toy_motion(spoken[0].units, CAMERA_HZ)
    motion = Motion(moved.values[:count], CAMERA_HZ, moved.channels)
    places = toy_places(count)
    video = encode_video(toy_frames(motion, places), CAMERA_HZ)
    takes = tuple(_take(sentence) for sentence in spoken[:2])
    about = {"name": "toy", "corpus": ["toy"], "speaker": "", "licence": ["synthesised by lipmotion"]}
    appearance = learn_appearance(toy_footage_pictures(sentences))
    return FilmedFace(appearance, StoredBackground(video, places, toy_chin_px(motion)), takes, about)


def toy_footage_pictures(sentences: int = 4) -> FootagePictures:
    """Return pictures of the lower face in toy sentences, at 25 frames a second, with motion and sound."""
    spoken = toy_sentences(sentences)
    motions = [toy_motion(sentence.units, CAMERA_HZ) for sentence in spoken]
    clips = tuple(toy_lower_faces(motion, seed=number) for number, motion in enumerate(motions))
    values = np.concatenate([motion.values for motion in motions])
    whole = Motion(values, CAMERA_HZ, motions[0].channels)

    def finer(frames: NDArray[np.intp]) -> Pictures:
        return toy_lower_faces(Motion(values[frames], CAMERA_HZ, whole.channels), seed=1000)

    levels = [_levels(sentence, len(motion.values)) for sentence, motion in zip(spoken, motions, strict=True)]
    return FootagePictures(clips, values, whole.channels, np.concatenate(levels), toy_chin_px(whole), SHAPE, 1, finer)


def _take(sentence: ToySentence) -> SpokenTake:
    motion = toy_motion(sentence.units, CAMERA_HZ)
    return SpokenTake(Audio(sentence.audio.samples, sentence.audio.rate_hz), motion, np.ones(len(motion.values), bool))


def _levels(sentence: ToySentence, frames: int) -> Array:
    levels = measure_levels_db(sentence.audio)
    return np.interp(np.arange(frames) / CAMERA_HZ, (np.arange(len(levels)) + 0.5) * STEP_S, levels)


def _shapes(motion: Motion) -> Array:
    """Return opening, width, outer and place of the chin in every frame, px of the face [shape=(T, 4)]."""
    distances = [motion[name] * EYE_DISTANCE_PX for name in ("opening", "width", "outer")]
    return np.column_stack([*distances, toy_chin_px(motion)])


def _picture(x: Values, y: Values, shape: Array, pixel_px: float, noise: float, draw: np.random.Generator) -> Pictures:
    """Return the toy person at some positions [each shape=(H, W)], px of the face, uint8 [shape=(H, W, 3)]."""
    opening, width, outer, chin = shape.tolist()
    middle = MOUTH_CORNER[1] + MOUTH_HEIGHT / 2
    x, y = x.astype(np.float32), y.astype(np.float32)
    picture: Values = np.array(WALL, np.float32) * (1 + 0.1 * np.sin(x / 17) * np.cos(y / 23))[..., None]
    picture = _over(picture, NECK, np.clip(0.5 + (NECK_PX - np.abs(x)) / pixel_px, 0, 1) * (y > 40))
    below = np.where(y > HEAD_MIDDLE_PX, chin - HEAD_MIDDLE_PX, HEAD_PX[1])
    skin = np.array(SKIN, np.float32) * (1 - 0.0006 * (y - 60) - 0.00002 * x**2)[..., None]
    crease = np.exp(-(((y - chin) / CREASE_PX[0] + 3) ** 2) - (x / CREASE_PX[1]) ** 2)
    skin = skin * (1 - CREASE * crease)[..., None]
    picture = _over(picture, skin, _inside(x, y - HEAD_MIDDLE_PX, HEAD_PX[0], below, pixel_px, 4))
    for side in (-30.0, 30.0):
        _paint(picture, EYES, _part(x - side, y, 15.0, 6.0, pixel_px))
    _paint(picture, LIPS, _part(x, y - middle, width / 2, outer / 2, pixel_px))
    if opening > MIN_OPENING_PX:
        part, inside = _part(x, y - middle, INNER_WIDTH * width / 2, opening / 2, pixel_px)
        _paint(picture, INSIDE, (part, inside))
        above = np.clip(0.5 + (middle - opening / 2 + TEETH_PX - y[part]) / pixel_px, 0, 1)
        teeth = above * (1 - 0.5 * (np.abs(x[part] % 6) < 1))
        _paint(picture, TEETH, (part, inside * teeth))
    picture = picture + np.float32(noise) * draw.standard_normal(picture.shape, np.float32)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _over(picture: Values, colour: tuple[float, ...] | Values, share: Values) -> Values:
    return (picture + share[..., None] * (np.asarray(colour, np.float32) - picture)).astype(np.float32)


def _paint(picture: Values, colour: tuple[float, ...], shape: tuple[tuple[slice, slice], Values]) -> None:
    picture[shape[0]] = _over(picture[shape[0]], colour, shape[1])


def _part(x: Values, y: Values, across: float, down: float, pixel_px: float) -> tuple[tuple[slice, slice], Values]:
    """Return the rows and columns that an ellipse reaches, and the share of each of their pixels inside it."""
    reach = 1 + 0.5 * pixel_px / min(across, down)
    at = np.nonzero((np.abs(x) < across * reach) & (np.abs(y) < down * reach))
    rows, columns = (slice(int(each.min(initial=each.size)), int(each.max(initial=-1)) + 1) for each in at)
    part = rows, columns
    return part, _inside(x[part], y[part], across, down, pixel_px)


def _inside(x: Values, y: Values, across: float, down: float | Values, pixel_px: float, power: int = 2) -> Values:
    """Return the share of each pixel inside a centred superellipse of two half axes [shape of x]."""
    radius = (np.abs(x / across) ** power + np.abs(y / down) ** power) ** (1 / power)
    return np.clip(0.5 + (1 - radius) * np.minimum(across, down) / pixel_px, 0, 1)
