"""Pictures of meshes without a graphics card: a camera, triangles with their textures, and what alone moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.meshes.model.mesh import BLEND, MASK, Mesh, Texture
from lipmotion_faces.characters.textures import TextureTable, decode_srgb, find_opacity_range, reduce_textures
from lipmotion_faces.kernels.raster import draw
from lipmotion_faces.kernels.textured import (
    CLEAR,
    CUT,
    HIDING_OPACITY,
    SEEN_OPACITY,
    SOLID,
    TexturedTriangles,
    draw_textured,
)
from lipmotion_faces.rendering.lighting import LEVELS, WHITE, Finish, Lighting, make_tone_table

Real = NDArray[np.float64]
Colours = NDArray[np.float32]
Picture = NDArray[np.uint8]
LARGEST_GREY = 255


@dataclass(frozen=True)
class Camera:
    """A camera on the z axis that looks along -z.

    width, height : of the picture in pixels, even
    centre        : x and y in the middle of the picture, in the unit of the vertices
    across        : height of the picture at z = 0, in the same unit
    distance      : of the camera from z = 0
    Raises InputError: a size that is odd or under 64 pixels, or a length that is not positive.
    """

    width: int = 1280
    height: int = 720
    centre: tuple[float, float] = (0.0, 0.0)
    across: float = 3.6
    distance: float = 9.0

    def __post_init__(self) -> None:
        for name, size in (("width", self.width), ("height", self.height)):
            if size < 64 or size % 2:
                raise InputError(f"the {name} is {size} pixels, required an even number of at least 64")
        if not (self.across > 0 and self.distance > 0):
            raise InputError(f"the camera sees {self.across} from {self.distance} away, required more than 0")

    def project(self, places: Real) -> Real:
        """Return column and row in pixels, and depth, of places in space [shape=(V, 3)]."""
        scale = self.height / self.across * self.distance / np.maximum(self.distance - places[:, 2], 1e-6)
        column = self.width / 2 + (places[:, 0] - self.centre[0]) * scale
        row = self.height / 2 - (places[:, 1] - self.centre[1]) * scale
        return np.stack([column, row, -1 / np.maximum(self.distance - places[:, 2], 1e-6)], axis=1)

    @property
    def place(self) -> Real:
        """The place of the camera [shape=(3,)]."""
        return np.array([*self.centre, self.distance])

    def find_box(self, screen: Real) -> tuple[int, int, int, int] | None:
        """Return first column and row, and those behind the last, around what ``project`` returned; None: outside."""
        columns, rows = np.ascontiguousarray(screen[:, :2].T)  # numpy is slow along short rows
        left, top = (max(0, int(each.min() - 2)) for each in (columns, rows))
        right = min(self.width, int(np.ceil(columns.max() + 2)))
        bottom = min(self.height, int(np.ceil(rows.max() + 2)))
        return (left, top, right, bottom) if left < right and top < bottom else None


class Canvas:
    """A picture on which triangles are drawn, four samples a pixel."""

    def __init__(self, camera: Camera, background: Colours | None = None) -> None:
        self.camera = camera
        self.background = fill_gradient(camera) if background is None else background
        self._tone = make_tone_table()
        level = np.clip(self.background, 0, 1) * np.float32(LEVELS - 1)
        self.empty: NDArray[np.uint8] = self._tone[level.astype(int)]
        """The picture of the background alone [shape=(H, W, 3)]."""

    def draw(
        self,
        places: Real,
        colours: Colours,
        triangles: NDArray[np.int32],
        *,
        onto: NDArray[np.uint8] | None = None,
        moving: slice = slice(None),
    ) -> NDArray[np.uint8]:
        """Return a new picture of triangles before the background [shape=(H, W, 3)].

        places    : of the vertices in space [shape=(V, 3)]
        colours   : of the vertices, as ``Lighting`` gives them [shape=(V, 3)]
        triangles : counterclockwise from outside; those that are seen from behind are not drawn [shape=(F, 3)]
        onto      : a picture to which the new one is equal outside the box of ``moving``
        moving    : rows of vertices; only the smallest box of pixels around them is drawn
        """
        screen = self.camera.project(places)
        picture = (self.empty if onto is None else onto).copy()
        area = self.camera.find_box(screen[moving])
        if area is not None:
            draw(screen, colours, triangles, area, self.background, self._tone, picture)
        return picture

    def cut_out(self, places: Real, colours: Colours, triangles: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return triangles without background: red, green, blue and straight alpha [shape=(H, W, 4)]."""
        picture = self.draw(places, colours, triangles)
        alpha = self.cover(places, np.ones(len(places), bool), triangles)
        return add_alpha(picture, alpha, self._tone)

    def cover(self, places: Real, marked: NDArray[np.bool_], triangles: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Return which part of every pixel shows marked vertices, 0 to 255 [shape=(H, W)]; others hide them."""
        size = self.camera.height, self.camera.width, 3
        light = np.repeat(marked[:, None], 3, axis=1).astype(np.float32)
        picture, area = np.zeros(size, np.uint8), (0, 0, size[1], size[0])
        tone = np.arange(256).astype(np.uint8)
        draw(self.camera.project(places), light, triangles, area, np.zeros(size, np.float32), tone, picture)
        return picture[..., 0]


def add_alpha(picture: NDArray[np.uint8], alpha: NDArray[np.uint8], tone: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture before black [shape=(H, W, 3)] with its cover as straight alpha; the picture is changed."""
    partly = (alpha > 0) & (alpha < LARGEST_GREY)
    level = np.searchsorted(tone, picture[partly]) / (alpha[partly, None] / LARGEST_GREY)
    picture[partly] = tone[np.minimum(level, LEVELS - 1).astype(int)]
    return np.concatenate([picture, alpha[..., None]], axis=2)


def fill(camera: Camera, colour: tuple[int, int, int]) -> Colours:
    """Return a background of one colour (sRGB, 0 to 255), as parts of ``WHITE`` [shape=(H, W, 3)]."""
    level = np.searchsorted(make_tone_table(), np.array(colour)) / (LEVELS - 1)
    return np.broadcast_to(np.asarray(level, np.float32), (camera.height, camera.width, 3)).copy()


def fill_gradient(camera: Camera) -> Colours:
    """Return a background [shape=(H, W, 3)] brighter in the middle, as parts of ``WHITE``."""
    columns = (np.arange(camera.width) + 0.5 - camera.width / 2) / (0.75 * camera.height)
    rows = (np.arange(camera.height) + 0.5 - 0.42 * camera.height) / (0.75 * camera.height)
    near = np.exp(-(columns[None] ** 2) - rows[:, None] ** 2)[..., None]
    light = near * decode_srgb((0.86, 0.89, 0.9)) + (1 - near) * decode_srgb((0.56, 0.65, 0.7))
    return np.asarray(light / WHITE, dtype=np.float32)


class TexturedCanvas:
    """A picture on which triangles with textures are drawn, four samples a pixel."""

    def __init__(self, camera: Camera, surface: TexturedTriangles, background: Colours | None = None) -> None:
        self.camera, self.surface = camera, surface
        canvas = Canvas(camera, background)
        self._background, self.empty = canvas.background, canvas.empty
        self._black = fill(camera, (0, 0, 0))
        self._tone = make_tone_table()

    def draw(
        self, places: Real, light: Colours, shine: Colours, *, onto: Picture | None = None, moving: Real | None = None
    ) -> Picture:
        """Return a new picture of the surface before the background [shape=(H, W, 3)].

        places : of the vertices in space [shape=(V, 3)]
        light  : of the vertices, what a white surface sends to the viewer; shine : highlights [shape=(V, 3), both]
        onto   : a picture to which the new one is equal outside the box of ``moving``
        moving : places of vertices; only the smallest box of pixels around them is drawn
        """
        picture = (self.empty if onto is None else onto).copy()
        self._draw(places, light, shine, self._background, picture, moving)
        return picture

    def cut_out(self, places: Real, light: Colours, shine: Colours) -> Picture:
        """Return the surface without background: red, green, blue and straight alpha [shape=(H, W, 4)]."""
        picture = np.zeros((self.camera.height, self.camera.width, 3), np.uint8)
        return add_alpha(picture, self._draw(places, light, shine, self._black, picture), self._tone)

    def _draw(
        self,
        places: Real,
        light: Colours,
        shine: Colours,
        behind: Colours,
        picture: Picture,
        moving: Real | None = None,
    ) -> Picture:
        opacity, points = np.zeros(picture.shape[:2], np.uint8), self.camera.project(places)
        area = self.camera.find_box(points if moving is None else self.camera.project(moving))
        if area is not None:
            draw_textured(points, light, shine, self.surface, area, behind, self._tone, picture, opacity)
        return opacity


Rows = NDArray[np.int64]

MIN_OPACITY = 0.5  # parts without texture that are clearer than this are not drawn: shells around eyes
SCATTER = (0.3, 0.2, 0.15)  # how far red, green and blue light reach round into the shade, as in skin
FARTHEST_UV = 1e4
EMPTY = 3  # the kind of triangles whose texture is clear all over: they are left out


@dataclass(frozen=True, eq=False)
class DrawnSurface:
    """What is drawn of a mesh."""

    rows: Rows  # the vertex of the mesh that each drawn vertex is [shape=(D,)]
    sides: Real  # 1, or -1 where the surface is seen from behind [shape=(D,)]
    kinds: Rows  # the finish of each drawn vertex [shape=(D,)];  lighting : for these finishes
    lighting: Lighting
    colours: Real  # diffuse reflection by which that of the texture is multiplied [shape=(D, 3)]
    triangles: TexturedTriangles  # of drawn vertices, with textures


def prepare_surface(mesh: Mesh, shown: NDArray[np.bool_], pixels_per_unit: float) -> DrawnSurface:
    """Return what is drawn of a mesh, with textures reduced to its size, in pixels for the mesh's unit."""
    materials = [part.material for part in mesh.parts]
    part_of = np.repeat(np.arange(len(mesh.parts)), [part.stop - part.first for part in mesh.parts])
    hidden = np.array([m.texture is None and m.opacity < MIN_OPACITY for m in materials])
    chosen = np.flatnonzero(shown & ~hidden[part_of])
    double = chosen[np.array([m.two_sided for m in materials])[part_of[chosen]]]
    behind = np.repeat([False, True], [len(chosen), len(double)])
    numbers = np.concatenate([chosen, double])
    nearest_first = np.argsort(-mesh.vertices[mesh.triangles[numbers], 2].max(axis=1), kind="stable")
    numbers, behind = numbers[nearest_first], behind[nearest_first]  # what is hidden is soon found to be so
    corners = mesh.triangles[numbers].astype(np.int64)
    corners[behind] = corners[behind][:, ::-1]
    uv = np.zeros((len(numbers), 3, 2)) if mesh.uv is None else np.clip(mesh.uv[numbers], -FARTHEST_UV, FARTHEST_UV)
    uv[behind] = uv[behind][:, ::-1]
    textures: dict[Texture, int] = {}
    for material in materials:
        if material.texture is not None:
            textures.setdefault(material.texture, len(textures))
    looks = _texture(mesh, numbers, part_of[numbers], uv, reduce_textures(list(textures)), textures, pixels_per_unit)
    visible = looks.looks[:, 1] != EMPTY
    looks = looks._replace(uv=looks.uv[visible], looks=looks.looks[visible], alphas=looks.alphas[visible])
    numbers, corners, behind = numbers[visible], corners[visible], behind[visible]
    keys = (corners * len(materials) + part_of[numbers][:, None]) * 2 + behind[:, None]
    unique, inverse = np.unique(keys, return_inverse=True)
    kinds, rows = unique // 2 % len(materials), unique // 2 // len(materials)
    finishes = [Finish(SCATTER, gloss=0.5 * m.gloss, focus=4 + round(2 * m.gloss)) for m in materials]
    colours = np.array([decode_srgb(m.colour) for m in materials])[kinds]
    if mesh.tints is not None:
        colours = colours * mesh.tints[rows, :3]
    if mesh.colours is not None:  # those of textures have the colour of the material alone
        textured = np.array([m.texture is not None for m in materials])[kinds]
        colours = np.where(textured[:, None], colours, decode_srgb(mesh.colours[rows]))
    return DrawnSurface(
        rows,
        np.where(unique % 2 == 1, -1.0, 1.0),
        kinds,
        Lighting(finishes),
        colours,
        looks._replace(triangles=inverse.reshape(corners.shape).astype(np.int32)),
    )


def _texture(
    mesh: Mesh,
    numbers: Rows,
    parts: Rows,
    uv: Real,
    table: TextureTable,
    textures: dict[Texture, int],
    pixels_per_unit: float,
) -> TexturedTriangles:
    """Return the triangles with their textures; the vertices are filled in by the caller."""
    looks = np.zeros((len(numbers), 2), np.int32)
    alphas = np.ones((len(numbers), 2))
    corner = mesh.vertices[mesh.triangles[numbers]]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    on_screen = 0.5 * np.linalg.norm(across, axis=1) * pixels_per_unit**2
    one, two = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    downwards = uv * (1.0, -1.0) + (0.0, 1.0)
    in_texture = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    ends = np.cumsum(np.bincount(parts, minlength=len(mesh.parts)))
    for mine, part in zip(np.split(np.argsort(parts, kind="stable"), ends[:-1]), mesh.parts, strict=True):
        material = part.material
        looks[mine] = -1, SOLID
        if material.texture is not None:
            kind = {MASK: CUT, BLEND: CLEAR}.get(material.alpha, SOLID)
            looks[mine, 0] = table.pick(textures[material.texture], in_texture[mine], on_screen[mine])
            alphas[mine] = material.cutoff, 1.0 if kind == SOLID else material.opacity
            if kind != SOLID:
                halvings = looks[mine, 0] - table.first[textures[material.texture]]
                ends_uv, texels = downwards[mine], 2 * 2 ** halvings.astype(np.int64)
                lowest, highest = find_opacity_range(material.texture, ends_uv.min(axis=1), ends_uv.max(axis=1), texels)
                lowest, highest = lowest * material.opacity, highest * material.opacity
                hides, seen = (material.cutoff, material.cutoff) if kind == CUT else (HIDING_OPACITY, SEEN_OPACITY)
                looks[mine, 1] = np.where(lowest >= hides, SOLID, np.where(highest < seen, EMPTY, kind))
        if mesh.tints is not None and material.alpha in (MASK, BLEND):
            opacity = mesh.tints[mesh.triangles[numbers[mine]], 3].mean(axis=1)
            is_cut = material.alpha == MASK
            kind, hides, seen = (
                (CUT, material.cutoff, material.cutoff) if is_cut else (CLEAR, HIDING_OPACITY, SEEN_OPACITY)
            )
            cover = material.opacity * opacity
            kinds, bare = looks[mine, 1], looks[mine, 0] < 0
            lowered = np.where(cover < seen, EMPTY, np.where((cover < hides) | ~bare & (opacity < 1), kind, kinds))
            looks[mine, 1] = np.where(kinds == EMPTY, EMPTY, lowered)
            alphas[mine] = np.stack([np.full(len(cover), material.cutoff), cover], axis=1)
    return TexturedTriangles(np.zeros((0, 3), np.int32), downwards, looks, alphas, table.texels, table.levels)
