"""A character of the user's own: a drawing in layers, of which one mouth at a time is shown."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from difflib import get_close_matches
from functools import cached_property, lru_cache, partial
from importlib import resources
from itertools import compress
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import SCENE, TRANSPARENT, DrawnMotion, Face, Staging
from lipmotion_faces.kernels.painting import warp_bytes
from lipmotion_faces.portrait.geometry import PIVOT_Y, MouthPose
from lipmotion_faces.portrait.layer import lay_over
from lipmotion_faces.portrait.portrait_rasteriser import FacePose, list_face_poses
from lipmotion_faces.portrait.svg_document import LAYERS, MOUTH, Drawing, Shape, read_drawing

Pixels = NDArray[np.float32]  # premultiplied colour 0..255 and cover 0..1 [shape=(H, W, 4)]
Lines = Sequence[tuple[NDArray[np.float64], bool]]
"""Points in pixels [shape=(N, 2)], and whether each line returns to its beginning."""
SUPERSAMPLING = 3


Placed = tuple[Shape, tuple[float, float]]  # a shape, and how far it is moved to the right and down, in pixels


def paint_shapes(shapes: Sequence[Placed], to_pixels: NDArray[np.float64], width: int, height: int) -> Pixels:
    """Return shapes from back to front on nothing; ``to_pixels``: from the units of the drawing [shape=(2, 3)]."""
    layer = np.zeros((height, width, 4), np.float32)
    scale = float(np.sqrt(abs(np.linalg.det(to_pixels[:, :2]))))
    for shape, moved in shapes:
        lines = [
            (np.clip(points @ to_pixels[:, :2].T + to_pixels[:, 2] + moved, -1e5, 1e5), closed)
            for points, closed in shape.lines
        ]
        if shape.fill is not None and shape.opacities[0] > 0:
            _lay(layer, lines, partial(_cover_inside, even_odd=shape.even_odd), shape.fill, shape.opacities[0])
        if shape.stroke is not None and shape.opacities[1] > 0 and shape.width > 0:
            thickness = min(shape.width * scale, 2 * height)
            cover = partial(_cover_lines, thickness=thickness)
            _lay(layer, lines, cover, shape.stroke, shape.opacities[1], margin=thickness / 2)
    return layer


def _lay(
    layer: Pixels,
    lines: Lines,
    cover: Callable[[Lines, int, int], Pixels],
    colour: tuple[int, int, int],
    opacity: float,
    margin: float = 0.0,
) -> None:
    """Paint lines on a layer, with how ``cover`` covers a window around them that is ``margin`` pixels wider."""
    if not lines:
        return
    height, width = layer.shape[:2]
    left, top, right, bottom = _cut_window(np.vstack([points for points, _ in lines]), margin, width, height)
    if left < right and top < bottom:
        part = layer[top:bottom, left:right]
        inside = [(points - (left, top), closed) for points, closed in lines]
        share = opacity * cover(inside, right - left, bottom - top)[..., None]
        part += share * (np.array([*colour, 1], np.float32) - part)


def _cut_window(points: NDArray[np.float64], margin: float, width: int, height: int) -> tuple[int, int, int, int]:
    """Return the whole pixels around points that are in a picture: left, top, right, bottom."""
    left, top = np.floor(points.min(axis=0) - margin - 1)
    right, bottom = np.ceil(points.max(axis=0) + margin + 1)
    return max(int(left), 0), max(int(top), 0), min(int(right), width), min(int(bottom), height)


def _cover_inside(lines: Lines, width: int, height: int, *, even_odd: bool) -> Pixels:
    """Return the cover of the inside of subpaths, 0..1 [shape=(height, width)]."""
    from PIL import Image, ImageDraw

    winding = np.zeros((height * SUPERSAMPLING, width * SUPERSAMPLING), np.int16)
    for points, _ in lines:
        left, top, right, bottom = _cut_window(points, 0.0, width, height)
        if len(points) > 2 and left < right and top < bottom:
            large = Image.new("L", ((right - left) * SUPERSAMPLING, (bottom - top) * SUPERSAMPLING))
            corners = ((points - (left, top)) * SUPERSAMPLING - 0.5).tolist()
            ImageDraw.Draw(large).polygon([tuple(p) for p in corners], fill=1)
            x, y = points.T
            turns = 1 if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) >= 0 else -1
            rows, columns = (slice(a * SUPERSAMPLING, b * SUPERSAMPLING) for a, b in ((top, bottom), (left, right)))
            winding[rows, columns] += turns * np.asarray(large, np.int16)
    return _reduce(winding % 2 != 0 if even_odd else winding != 0)


def _cover_lines(lines: Lines, width: int, height: int, *, thickness: float) -> Pixels:
    """Return the cover of lines with round ends and corners, 0..1 [shape=(height, width)]."""
    from PIL import Image, ImageDraw

    large = Image.new("L", (width * SUPERSAMPLING, height * SUPERSAMPLING))
    draw, thick = ImageDraw.Draw(large), max(1, round(thickness * SUPERSAMPLING))
    for points, closed in lines:
        path = np.vstack([points, points[:1]]) if closed else points
        at = [tuple(p) for p in (path * SUPERSAMPLING - 0.5).tolist()]
        draw.line(at, fill=1, width=thick)
        if thick > 2:
            for x, y in at:
                draw.ellipse([x - thick / 2, y - thick / 2, x + thick / 2, y + thick / 2], fill=1)
    return _reduce(np.asarray(large, bool))


def _reduce(mask: NDArray[np.bool_]) -> Pixels:
    height, width = mask.shape[0] // SUPERSAMPLING, mask.shape[1] // SUPERSAMPLING
    parts = mask.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING)
    return np.asarray(parts.mean(axis=(1, 3)), np.float32)


OWN_SIZE = 640
CHANGE_COST = 0.007
"""A change of mouths costs as much as this squared distance at 2 frames a second, so that none is shown too shortly."""
EYE_DISTANCE = 0.285  # height of the picture that stands for an eye distance, in which heads and eyes are moved


MOOD_RISE, MOOD_FALL = 0.1, 0.08  # how far a mood raises and lowers the brows, which are one layer
_POSES = json.loads(resources.files(__package__).joinpath("mouths.json").read_text(encoding="ascii"))
MOUTHS = {name: MouthPose(**pose) for name, pose in _POSES.items()}
"""The mouths that a drawing may have, as layers ``mouth-NAME``; ``rest`` is required, what is missing is replaced."""
_WEIGHTS = {"gap": 5.0, "width": 1.5, "tongue": 1.0, "tuck": 0.9, "protrusion": 1.0, "teeth": 1.8, "oval": 1.0}
"""How much each number of a pose counts in the choice of its mouth."""


@final
class LayeredFace(Face):
    """A drawing in layers (docs/faces.md)."""

    def __init__(self, path: Path) -> None:
        """Raise InputError: the file is no drawing, or has no layer ``mouth-rest``."""
        self.path, self.staging = path, Staging()
        self.prosody: Prosody | None = None
        self.layers = read_drawing(path)
        names = {name for layers, _ in self.layers.shapes for name in layers}
        self.mouths = tuple(name for name in MOUTHS if MOUTH + name in names)
        unknown = sorted(name for name in names if name.startswith(MOUTH) and name[len(MOUTH) :] not in MOUTHS)
        if unknown:
            known = ", ".join(MOUTH + name for name in MOUTHS)
            raise InputError(f"{path}: unknown layer {shorten(unknown[0])!r}; the mouths are: {known}")
        if "rest" not in self.mouths:
            other = shorten(", ".join(sorted(names)) or "none")
            raise InputError(f"{path}: no layer {MOUTH}rest, required for the closed mouth; the layers are: {other}")
        _warn_of_still_layers(self.layers, path, len(self.mouths))

    def with_staging(self, staging: Staging, prosody: Prosody | None = None) -> LayeredFace:
        """Return the same drawing with other settings; ``prosody`` is of the speech that will be rendered."""
        other = copy(self)
        other.__dict__.pop("_painter", None)
        other.staging, other.prosody = staging, prosody
        return other

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return iter(self.draw(motion, units, fps=fps))

    def draw(  # noqa: D102
        self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0
    ) -> DrawnMotion[tuple[FacePose, str]]:
        poses = list_face_poses(motion, units, fps, self.staging, self.prosody)
        shown = choose_mouths([pose.mouth for pose in poses], self.mouths, fps)
        return DrawnMotion(list(zip(poses, shown, strict=True)), lambda: self._painter)

    @cached_property
    def _painter(self) -> Callable[[tuple[FacePose, str]], NDArray[np.uint8]]:
        picture = _LayeredPicture(self.layers, self.staging)
        return lambda pose: picture.draw(*pose)


def _warn_of_still_layers(drawing: Drawing, path: Path, mouths: int) -> None:
    """Warn of a mouth that is always the same, and of layers outside of known ones, whose names are like theirs."""
    known = {*LAYERS, *(MOUTH + name for name in MOUTHS)}
    still = {name for layers, _ in drawing.shapes if not known.intersection(layers) - {"head"} for name in layers}
    for name in sorted(name for name in still - known if any(name[:3] == each[:3] for each in known)):
        for near in get_close_matches(name, known, 1, 0.85):
            warnings.warn(f"{path}: the layer {shorten(name)!r} stands still (is it {near}?)", stacklevel=2)
    if mouths == 1:
        warnings.warn(f"{path}: {MOUTH}rest is the only mouth, and is always shown; draw others", stacklevel=2)


def choose_mouths(poses: Sequence[MouthPose], mouths: Sequence[str], fps: float) -> list[str]:
    """Return the mouth to show in every frame: near the poses, and changing no more often than pays.

    The cheapest sequence is found by dynamic programming; a closed mouth is shown whenever the lips are closed, even
    for a single frame.
    """
    keys, values = (
        np.array([[getattr(pose, name) for name in _WEIGHTS] for pose in some])
        for some in ([MOUTHS[name] for name in mouths], poses)
    )
    distance = np.square((values[:, None] - keys) * [*_WEIGHTS.values()]).sum(axis=2)
    shut = np.array([name in ("rest", "mbp") for name in mouths])
    distance[np.ix_((values[:, 0] < 1e-6) & (values[:, 3] < 0.3), ~shut)] += 100.0  # closed lips show a closed mouth
    change = CHANGE_COST * fps / 2
    cost, back = distance[0].copy(), np.zeros(distance.shape, int)
    for n in range(1, len(distance)):
        best = int(cost.argmin())
        back[n] = np.where(cost <= cost[best] + change, np.arange(len(mouths)), best)
        cost = np.minimum(cost, cost[best] + change) + distance[n]
    at, path = int(cost.argmin()), []
    for n in range(len(distance) - 1, -1, -1):
        path.append(mouths[at])
        at = int(back[n, at])
    return path[::-1]


def _is_of_head(layers: Sequence[str]) -> bool:
    """Return whether a shape moves with the head, in whose layer mouths, eyes and brows need not be."""
    return any(name.startswith(MOUTH) or (name in LAYERS and name != "background") for name in layers)


class _LayeredPicture:
    def __init__(self, drawing: Drawing, staging: Staging) -> None:
        self._size = staging.size or OWN_SIZE
        self._opaque, self._scene = staging.background != TRANSPARENT, staging.background == SCENE
        x, y, width, height = drawing.box
        self._width = max(2, 2 * round(self._size * width / height / 2))
        scale = self._size / height
        self._to_pixels = np.array([[scale, 0, -x * scale], [0, scale, -y * scale]])
        has_head = any("head" in layers for layers, _ in drawing.shapes)
        moving = [not has_head or _is_of_head(layers) for layers, _ in drawing.shapes]
        self._head = list(compress(drawing.shapes, moving))
        behind: list[Placed] = []
        front: list[Placed] = []
        passed = False
        for (layers, shape), moves in zip(drawing.shapes, moving, strict=True):
            if moves:
                passed = True
            elif self._scene or "background" not in layers:
                (front if passed else behind).append((shape, (0.0, 0.0)))
        self._behind, self._front = self._paint(behind), self._paint(front)
        colour = staging.colour or ((255, 255, 255) if self._scene else None)
        if colour is not None:
            wall = np.ones_like(self._behind) * np.array([*colour, 1], np.float32)
            self._behind = lay_over(self._behind, wall)
        self._heads = lru_cache(maxsize=64)(self._paint_head)

    def draw(self, pose: FacePose, mouth: str) -> NDArray[np.uint8]:
        """Return one frame [shape=(H, W, 3 or 4)]."""
        unit = EYE_DISTANCE * self._size
        mood = pose.mood
        brows = pose.brows + MOOD_RISE * (mood.inner + mood.outer) / 2 - MOOD_FALL * mood.lowered
        look = (round(pose.gaze_x * unit), round(pose.gaze_y * unit), round(brows * unit))
        head = self._heads(mouth, "closed" if pose.lids > 0.5 else "open", *look)
        moved = np.empty(head.shape, np.uint8)
        place = pose.head
        columns, rows = np.arange(0, self._width + 16, 16.0), np.arange(0, self._size + 16, 16.0)
        x = np.broadcast_to(columns - self._width / 2, (len(rows), len(columns)))
        y = np.broadcast_to((rows - 0.4 * self._size - PIVOT_Y * unit)[:, None], x.shape)
        right, down = (place.x + 0.5 * place.yaw) * unit, (place.y + 0.5 * place.pitch) * unit
        warp_bytes(head, place.roll * y - right, -place.roll * x - down, 16, moved)
        layer = moved.astype(np.float32) * np.array([1, 1, 1, 1 / 255], np.float32)
        picture = lay_over(self._front, lay_over(layer, self._behind))
        if self._opaque:
            return np.asarray(picture[..., :3] + 0.5, np.uint8)
        alpha = picture[..., 3:]
        straight = np.where(alpha > 0, picture[..., :3] / np.maximum(alpha, 1e-6), 0)
        return np.asarray(np.clip(np.dstack([straight, alpha * 255]) + 0.5, 0, 255), np.uint8)

    def _paint_head(self, mouth: str, eyes: str, gaze_x: int, gaze_y: int, brows: int) -> NDArray[np.uint16]:
        shown: list[Placed] = []
        for layers, shape in self._head:
            hidden = any(name.startswith(MOUTH) and name != MOUTH + mouth for name in layers)
            hidden |= not self._scene and "background" in layers
            hidden |= ("eyes-open" in layers and eyes == "closed") or ("eyes-closed" in layers and eyes == "open")
            if not hidden:
                moved = (gaze_x, gaze_y) if "pupils" in layers else (0, -brows) if "brows" in layers else (0, 0)
                shown.append((shape, (float(moved[0]), float(moved[1]))))
        return np.asarray(self._paint(shown) * (1, 1, 1, 255) + 0.5, np.uint16)

    def _paint(self, shapes: Sequence[Placed]) -> Pixels:
        return paint_shapes(shapes, self._to_pixels, self._width, self._size)
