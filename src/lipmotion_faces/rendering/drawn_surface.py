"""The surface of a mesh as it is drawn: each triangle with its texture, each vertex once a material and a side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.model.mesh import BLEND, MASK, Material, Mesh
from lipmotion.meshes.model.textures import Texture, TextureTable, decode_srgb, texture_table
from lipmotion_faces.kernels.textured import (
    CLEAR,
    CUT,
    HIDING_OPACITY,
    SEEN_OPACITY,
    SOLID,
    TexturedTriangles,
    draw_textured,
)
from lipmotion_faces.rendering.lighting import Finish, Lighting, tone_table
from lipmotion_faces.rendering.rasteriser import Camera, Canvas, Colours, add_alpha, flat

Real = NDArray[np.float64]
Picture = NDArray[np.uint8]


class TexturedCanvas:
    """A picture on which triangles with textures are drawn, four samples a pixel."""

    def __init__(self, camera: Camera, surface: TexturedTriangles, background: Colours | None = None) -> None:
        self.camera, self.surface = camera, surface
        canvas = Canvas(camera, background)
        self._background, self.empty = canvas.background, canvas.empty
        self._black = flat(camera, (0, 0, 0))
        self._tone = tone_table()

    def picture(
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
        opacity, points = np.zeros(picture.shape[:2], np.uint8), self.camera.on_screen(places)
        area = self.camera.box(points if moving is None else self.camera.on_screen(moving))
        if area is not None:
            draw_textured(points, light, shine, self.surface, area, behind, self._tone, picture, opacity)
        return opacity


Array = NDArray[np.float64]
Rows = NDArray[np.int64]

LEAST_OPACITY = 0.5
"""Parts without texture that are clearer than this are not drawn: shells around eyes."""
SCATTER = (0.3, 0.2, 0.15)
"""How far red, green and blue light reach round into the shade, as in skin."""
FARTHEST_UV = 1e4
EMPTY = 3
"""The kind of triangles whose texture is clear all over: they are left out."""


@dataclass(frozen=True, eq=False)
class DrawnSurface:
    """What is drawn of a mesh.

    rows     : the vertex of the mesh that each drawn vertex is [shape=(D,)]
    sides    : 1, or -1 where the surface is seen from behind [shape=(D,)]
    kinds    : the finish of each drawn vertex [shape=(D,)];  lighting : for these finishes
    colours  : diffuse reflection by which that of the texture is multiplied [shape=(D, 3)]
    triangles : of drawn vertices, with textures
    """

    rows: Rows
    sides: Array
    kinds: Rows
    lighting: Lighting
    colours: Array
    triangles: TexturedTriangles


def drawn_surface(mesh: Mesh, shown: NDArray[np.bool_], pixels_per_unit: float) -> DrawnSurface:
    """Return what is drawn of a mesh, with textures reduced to its size, in pixels for the mesh's unit."""
    materials = [part.material for part in mesh.parts]
    part_of = np.repeat(np.arange(len(mesh.parts)), [part.stop - part.first for part in mesh.parts])
    hidden = np.array([m.texture is None and m.opacity < LEAST_OPACITY for m in materials])
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
    looks = _looks(mesh, numbers, part_of[numbers], uv, texture_table(list(textures)), textures, pixels_per_unit)
    visible = looks.looks[:, 1] != EMPTY
    looks = looks._replace(uv=looks.uv[visible], looks=looks.looks[visible], alphas=looks.alphas[visible])
    numbers, corners, behind = numbers[visible], corners[visible], behind[visible]
    keys = (corners * len(materials) + part_of[numbers][:, None]) * 2 + behind[:, None]
    unique, inverse = np.unique(keys, return_inverse=True)
    kinds, rows = unique // 2 % len(materials), unique // 2 // len(materials)
    finishes = [Finish(SCATTER, gloss=0.5 * m.gloss, focus=4 + round(2 * m.gloss)) for m in materials]
    return DrawnSurface(
        rows,
        np.where(unique % 2 == 1, -1.0, 1.0),
        kinds,
        Lighting(finishes),
        _colours(mesh, materials, rows, kinds),
        looks._replace(triangles=inverse.reshape(corners.shape).astype(np.int32)),
    )


def _looks(
    mesh: Mesh,
    numbers: Rows,
    parts: Rows,
    uv: Array,
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
            looks[mine, 0] = table.level(textures[material.texture], in_texture[mine], on_screen[mine])
            alphas[mine] = material.cutoff, 1.0 if kind == SOLID else material.opacity
            if kind != SOLID:
                halvings = looks[mine, 0] - table.first[textures[material.texture]]
                ends_uv, texels = downwards[mine], 2 * 2 ** halvings.astype(np.int64)
                lowest, highest = material.texture.range_of_opacity(ends_uv.min(axis=1), ends_uv.max(axis=1), texels)
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


def _colours(mesh: Mesh, materials: list[Material], rows: Rows, kinds: Rows) -> Array:
    """Return the reflection of drawn vertices; those of textures have the colour of the material alone."""
    of_material = np.array([decode_srgb(material.colour) for material in materials])[kinds]
    textured = np.array([material.texture is not None for material in materials])[kinds]
    if mesh.tints is not None:
        of_material = of_material * mesh.tints[rows, :3]
    if mesh.colours is None:
        return of_material
    return np.where(textured[:, None], of_material, decode_srgb(mesh.colours[rows]))
