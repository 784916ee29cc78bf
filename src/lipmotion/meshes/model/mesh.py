"""A character's surface: vertices, triangles, parts with a material, named blendshapes, and bones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten

HEAD, NECK, JAW, LEFT_EYE, RIGHT_EYE = "head", "neck", "jaw", "leftEye", "rightEye"


@dataclass(frozen=True, eq=False)
class Bone:
    """A bone of a skeleton, or a node that other nodes hang on, and the vertices that follow it.

    kind   : ``HEAD``, ``NECK``, ``JAW``, ``LEFT_EYE`` or ``RIGHT_EYE``
    place  : where it turns about [shape=(3,)]
    rows   : the vertices that follow it or what hangs on it, ascending [shape=(N,)]
    shares : how far each follows, 0 to 1 [shape=(N,)]
    """

    kind: str
    place: NDArray[np.float64]
    rows: NDArray[np.int64]
    shares: NDArray[np.float64]


Array = NDArray[np.float64]
ANGLES = ("headYaw", "headPitch", "headRoll")
"""Channels of motion, in radians: to the character's left, up, and to its left shoulder."""
SIGNS = np.array([1.0, -1.0, -1.0])
ORDER = "YXZ"


def turn_head(angles: Array) -> Array:
    """Return a head's quaternions x, y, z, w [shape=(T, 4)], near their neighbours, from ``ANGLES`` [shape=(T, 3)]."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler(ORDER, angles * SIGNS).as_quat()
    same = np.einsum("tq,tq->t", turned[1:], turned[:-1]) >= 0
    return np.asarray(turned * np.concatenate([[1.0], np.cumprod(np.where(same, 1.0, -1.0))])[:, None])


def find_head_angles(quaternions: Array) -> Array:
    """Return the angles of a head from rotations, as of ``turn_head`` [shape=(T, 3)]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternions).as_euler(ORDER) * SIGNS)


OPAQUE, MASK, BLEND = "OPAQUE", "MASK", "BLEND"
"""How the opacity of a texture counts: not at all; there is a hole where it is low; what is behind shines through."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture: sRGB and opacity, 0 to 255, from the top [shape=(H, W, 4)]. Raises InputError: another shape."""

    pixels: NDArray[np.uint8]

    def __post_init__(self) -> None:
        shape = self.pixels.shape
        if self.pixels.dtype != np.uint8 or len(shape) != 3 or shape[2] != 4 or not self.pixels.size:
            raise InputError(f"a texture has shape {shape} of {self.pixels.dtype}, required (H, W, 4) of uint8")


@dataclass(frozen=True)
class Material:
    """How a part of a mesh looks.

    colour   : red, green and blue of the diffuse reflection, sRGB, 0 to 1
    gloss    : 0 is dull as cloth, 1 shines as a wet eye
    opacity  : 0 is clear as air, 1 hides what is behind
    texture  : the picture on it, whose colours are multiplied by ``colour``; None: it has one colour
    alpha    : how the opacity of the texture counts: ``OPAQUE``, ``MASK`` or ``BLEND``
    cutoff   : with ``MASK``, there is a hole where the opacity is below this
    two_sided : it is seen from behind as well
    """

    name: str = ""
    colour: tuple[float, float, float] = (0.8, 0.8, 0.8)
    gloss: float = 0.2
    opacity: float = 1.0
    texture: Texture | None = None
    alpha: str = OPAQUE
    cutoff: float = 0.5
    two_sided: bool = False


@dataclass(frozen=True)
class MeshPart:
    """A named range of triangles, ``first`` to ``stop - 1``, of one material."""

    name: str
    first: int
    stop: int
    material: Material = Material()


@dataclass(frozen=True, eq=False)
class Blendshape:
    """A named displacement of some of the vertices of a mesh.

    rows          : the vertices that move, ascending [shape=(N,)]
    displacements : how far they move at weight 1, in the mesh's own unit of length [shape=(N, 3)]
    source        : the curve that a table says moves it, "" none; None: what its name says
    """

    name: str
    rows: NDArray[np.int64]
    displacements: NDArray[np.float64]
    source: str | None = None

    @property
    def called(self) -> str:
        """The name by which it is known: that of its source, or its own."""
        return self.name if self.source is None else self.source

    @classmethod
    def between(cls, name: str, neutral: Array, shape: Array, *, smallest: float = 0.0) -> Blendshape:
        """Return the blendshape that moves the vertices ``neutral`` to ``shape`` [shape=(V, 3), both]."""
        change = shape - neutral
        rows = np.flatnonzero(np.abs(change).max(axis=1, initial=0.0) > smallest)
        return cls(name, rows, change[rows])


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles, with blendshapes.

    vertices  : places in the mesh's own frame and unit of length [shape=(V, 3)]; +y is up, +z is out of the face, +x is
                to the character's left, as in lipmotion's head frame
    triangles : three vertices each, counterclockwise where the surface is seen from outside [shape=(F, 3)]
    parts     : ranges of triangles that follow one another and together are all triangles; none stands for one
                part without a name
    shapes    : blendshapes, in the order of their weights
    uv        : the place of each triangle's corners in a texture, 0 to 1, v upwards [shape=(F, 3, 2)], or None
    colours   : of every vertex, sRGB, 0 to 1, in place of the materials' [shape=(V, 3)], or None
    bones     : of head, neck, jaw and eyes, where a file has a skeleton; at most one of each kind
    tints     : of every vertex, the light (linear) and the opacity by which those of textures and materials are
                multiplied, 0 to 1 [shape=(V, 4)], or None; ``colours`` are multiplied by it already
    Raises InputError: shapes of arrays that do not fit, values that are not finite, a triangle or a blendshape of a
    vertex that does not exist, parts that do not follow one another, or two blendshapes of one name.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    parts: tuple[MeshPart, ...] = ()
    shapes: tuple[Blendshape, ...] = ()
    uv: NDArray[np.float64] | None = None
    colours: NDArray[np.float64] | None = None
    bones: tuple[Bone, ...] = ()
    tints: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        _check_places("vertices", self.vertices)
        _check_rows("triangles", self.triangles, len(self.vertices))
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3:
            raise InputError(f"triangles have shape {self.triangles.shape}, required (F, 3)")
        corners, vertices = (*self.triangles.shape, 2), self.vertices.shape
        required = (("uv has", self.uv, corners), ("colours have", self.colours, vertices))
        for what, array, fitting in (*required, ("tints have", self.tints, (len(self.vertices), 4))):
            if array is not None and array.shape != fitting:
                raise InputError(f"{what} shape {array.shape}, required {fitting}")
        if not self.parts:
            object.__setattr__(self, "parts", (MeshPart("", 0, len(self.triangles)),))
        edges = [0, *(part.stop for part in self.parts)]
        if [part.first for part in self.parts] != edges[:-1] or edges[-1] != len(self.triangles):
            raise InputError(f"the parts of the mesh end at {edges[1:]}, required ranges of {len(self.triangles)}")
        for shape in self.shapes:
            _check_places(f"the blendshape {shorten(shape.name)!r}", shape.displacements)
            _check_rows(f"the blendshape {shorten(shape.name)!r}", shape.rows, len(self.vertices))
            if shape.rows.shape != shape.displacements.shape[:1]:
                what = f"the blendshape {shorten(shape.name)!r} moves {shape.rows.shape} vertices by"
                raise InputError(f"{what} {shape.displacements.shape} displacements, required as many")
        if len(set(self.shape_names)) != len(self.shapes):
            raise InputError(f"two blendshapes have one name among {shorten(', '.join(self.shape_names))}; rename one")

    @property
    def shape_names(self) -> tuple[str, ...]:
        """The names of the blendshapes, in order."""
        return tuple(shape.name for shape in self.shapes)

    def displacements(self, rows: NDArray[np.int64], names: Sequence[str] | None = None) -> NDArray[np.float64]:
        """Return how far blendshapes move the vertices ``rows`` [shape=(N,)] at weight 1 [shape=(S, N, 3)]."""
        by_name = {shape.name: shape for shape in self.shapes}
        shapes = self.shapes if names is None else [by_name[name] for name in names]
        result = np.zeros((len(shapes), len(rows), 3))
        dense = np.zeros_like(self.vertices)
        for shape, chosen in zip(shapes, result, strict=True):
            dense[shape.rows] = shape.displacements
            chosen[:] = dense[rows]
            dense[shape.rows] = 0.0
        return result


def _check_places(what: str, values: NDArray[np.float64]) -> None:
    if values.ndim != 2 or values.shape[1] != 3 or values.dtype != np.float64:
        raise InputError(f"{what} have shape {values.shape} of {values.dtype}, required (N, 3) of float64")
    if not np.isfinite(values).all():
        raise InputError(f"{what} have values that are not finite; repair the mesh")


def _check_rows(what: str, rows: NDArray[np.integer], vertices: int) -> None:
    if rows.dtype.kind not in "iu":
        raise InputError(f"{what} count vertices in {rows.dtype}, required whole numbers")
    if rows.size and not 0 <= rows.min() <= rows.max() < vertices:
        raise InputError(f"{what} name vertices {rows.min()} to {rows.max()}, required 0 to {vertices - 1}")
