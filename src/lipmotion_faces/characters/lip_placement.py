"""Where the lip and jaw points of motion are on a mesh: found from a blendshape that opens the mouth, or named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import (
    INNER_CORNERS,
    LEFT_CORNER,
    LOWER_MIDDLE,
    RIGHT_CORNER,
    UPPER_MIDDLE,
    build_mouth,
)
from lipmotion.errors import InputError, shorten
from lipmotion.meshes.model.face_shapes import LipPlacement
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.meshes.model.shape_names import find_viseme, find_vowel, to_arkit
from lipmotion_faces.characters.surface import MeshSurface, build_surface

Rows = NDArray[np.int64]
Places = NDArray[np.float64]

SLIT_REACH = 0.06
"""The lips meet where vertices closer than this share of the width of the jaw go different ways as the mouth opens."""
SLIT_STEP = 0.2  # how different: this share of how far the jaw goes
DETOUR_RATIO = 2.0
"""They are on two lips if the way along the surface is this many times as long as the straight one, and more than the
distance between neighbours."""
LIP_LINE = 0.1
"""Vertices this close to the line between the corners, in widths of the mouth, are not joined with others at their
place where no blendshape tells the lips apart."""
FRONT_SHARE = 0.04  # behind the foremost of such pairs by more than this share are the insides of the mouth
DEPTH_WEIGHT = 0.35  # distances in depth count so much where a point is looked for, for lips protrude differently
EYE_CORNERS = (33, 263)
"""The outer corners of the eyes, right and left; in a list of named points they give the upright direction."""
MAX_PAIRS, MAX_DISTANCES = 1_000_000, 1 << 30
"""Pairs of vertices that are compared, about, and distances that are looked at for it: of meshes that are so dense
around the mouth, only some vertices are compared."""
DISTANCES_AT_ONCE = 1 << 22
STEEPEST, FURTHEST_TURN = 65, 40
"""Degrees by which the way of an opening mouth, and the line between its corners, may be off; jaws go back as well."""
UPRIGHT = (
    "turn the character so that it stands upright (+y up), looks along +z, its faces outwards, or name its lip points"
)
NEEDED = (RIGHT_CORNER, LEFT_CORNER, UPPER_MIDDLE, LOWER_MIDDLE)
"""The points that a list must name, where nothing is found by blendshapes."""


def place_lips_by_shape(mesh: Mesh, surface: MeshSurface) -> LipPlacement:
    """Return where the lip points are, from the blendshape that opens the mouth.

    The lips meet where neighbours go apart as the mouth opens; the ends of that line are the inner corners. The
    character must stand upright and look along +z, as files of OBJ and glTF have it.
    Raises InputError: no blendshape opens the mouth, or the lips are not found.
    """
    shape = find_opening_shape(mesh)
    _check_way(f"the way of {shorten(shape.name)!r}", shape.displacements.sum(axis=0), [0, -1, 0], "down", STEEPEST)
    drop = np.zeros(len(mesh.vertices))
    drop[shape.rows] = -shape.displacements[:, 1]
    still, moved = drop < 0.1 * drop.max(initial=0.0), drop > 0.5 * drop.max(initial=0.0)
    count = int(surface.pieces.max(initial=-1)) + 1
    counts = [np.bincount(surface.pieces[chosen], minlength=count) for chosen in (still, moved)]
    skin = surface.pieces == int(np.minimum(*counts).argmax())
    drop = np.where(skin, drop, 0.0) / max(float(drop[skin].max(initial=0.0)), 1e-12)
    middle = _find_slit(mesh.vertices, surface, drop, skin)
    if len(middle) < 3:
        raise InputError(
            f"the blendshape {shorten(shape.name)!r} parts no lips; name the lip points by their vertices "
            "(docs/meshes.md)"
        )
    template = build_mouth()
    right, left = middle[middle[:, 0].argmin()], middle[middle[:, 0].argmax()]
    _check_way("the line between the corners of the mouth", left - right, [1, 0, 0], "the axis x", FURTHEST_TURN)
    corners = [template.places[template.row(point)] for point in INNER_CORNERS]
    scale = float(left[0] - right[0]) / float(np.linalg.norm(corners[1] - corners[0]))
    order = np.argsort(middle[:, 0], kind="stable")
    targets = _aim(scale, (right + left) / 2, middle[order])
    rows = np.flatnonzero(skin)
    near = _tree(mesh.vertices[rows]).query(middle, k=min(12, len(rows)))[1].reshape(len(middle), -1)
    share = (drop[rows][near].max(axis=1) + drop[rows][near].min(axis=1)) / 2
    upper = drop < share[_tree(middle).query(mesh.vertices)[1]]
    vertices = _choose_vertices(mesh.vertices, surface.normals[:, 2], targets, skin, upper)
    return LipPlacement(template.points, vertices, scale, np.eye(3))


def _check_way(what: str, way: Places, axis: list[int], named: str, largest: int) -> None:
    off = np.degrees(np.arccos(np.clip(way @ np.array(axis) / max(float(np.linalg.norm(way)), 1e-12), -1, 1)))
    if off > largest:
        raise InputError(f"{what} is {off:.0f}° off {named}, required up to {largest}°: {UPRIGHT}")


def place_lips_by_points(mesh: Mesh, surface: MeshSurface, named: Mapping[int, int]) -> LipPlacement:
    """Return where the lip points are, from some that are named; the others are the nearest to the template.

    named : vertex of each point; the corners (61, 291) and the middles of the inner lips (13, 14) are required. With
            the eye corners (33, 263) the head may be turned any way; without, it must stand upright and look along +z
    Raises InputError: a required point is missing, a vertex does not exist, or the lips are one surface without a slit.
    """
    template = build_mouth()
    _check_named(named, len(mesh.vertices))
    place = {point: mesh.vertices[vertex] for point, vertex in named.items()}
    centre = (place[RIGHT_CORNER] + place[LEFT_CORNER]) / 2
    axes = np.eye(3)
    if all(point in place for point in EYE_CORNERS):  # x, y and z of the head as columns
        right_eye, left_eye = (place[point] for point in EYE_CORNERS)
        left = (left_eye - right_eye) / np.linalg.norm(left_eye - right_eye)
        up = (right_eye + left_eye) / 2 - centre
        up = up - left * (up @ left)
        up = up / np.linalg.norm(up)
        axes = np.stack([left, up, np.cross(left, up)], axis=1)
    scale = float(np.linalg.norm(place[LEFT_CORNER] - place[RIGHT_CORNER])) / template.width
    lips = [place[point] @ axes for point in (RIGHT_CORNER, LEFT_CORNER)]
    lips.append((place[UPPER_MIDDLE] + place[LOWER_MIDDLE]) / 2 @ axes)
    middle = np.array(sorted(lips, key=lambda place: float(place[0])))
    apart = surface.distances(np.array([named[UPPER_MIDDLE], named[LOWER_MIDDLE]]), np.inf)
    if apart[0, named[LOWER_MIDDLE]] < 0.2 * scale * template.width:
        raise InputError(
            f"vertices {named[UPPER_MIDDLE]} and {named[LOWER_MIDDLE]} hang together: the lips have no slit between "
            "them; cut the mouth open, or name other vertices of the inner lips"
        )
    skin = surface.pieces == surface.pieces[named[RIGHT_CORNER]]
    skin |= surface.pieces == surface.pieces[named[LOWER_MIDDLE]]
    targets = _aim(scale, centre @ axes, middle)
    vertices = _choose_vertices(mesh.vertices @ axes, surface.normals @ axes[:, 2], targets, skin, apart[0] < apart[1])
    for point, vertex in named.items():
        if point in template.points:
            vertices[template.row(point)] = vertex
    return LipPlacement(template.points, vertices, scale, axes)


def separate_named_lips(mesh: Mesh, named: Mapping[int, int]) -> MeshSurface:
    """Return a mesh's surface, its named lips apart even where they touch. Raises as ``place_lips_by_points``."""
    _check_named(named, len(mesh.vertices))
    surface = build_surface(mesh)
    if surface.places[named[UPPER_MIDDLE]] != surface.places[named[LOWER_MIDDLE]]:
        return surface
    right, left = mesh.vertices[named[RIGHT_CORNER]], mesh.vertices[named[LEFT_CORNER]]
    width = float(np.linalg.norm(left - right))
    along = (left - right) / max(width, 1e-12)
    from_middle = mesh.vertices - (left + right) / 2
    across = from_middle @ along
    lips = mesh.vertices[named[UPPER_MIDDLE]] - (left + right) / 2
    off = from_middle - across[:, None] * along
    bend = (1 - np.square(np.clip(2 * across / max(width, 1e-12), -1, 1)))[:, None] * (lips - (lips @ along) * along)
    split = (np.abs(across) < 0.499 * width) & (np.linalg.norm(off - bend, axis=1) < LIP_LINE * width)
    return build_surface(mesh, split)


def find_opening_shape(mesh: Mesh) -> Blendshape:
    """Return the blendshape that opens the mouth most: ``jawOpen``, ``aa`` or by name. Raises InputError: none."""
    tests: tuple[Callable[[str], bool], ...] = (
        lambda name: to_arkit(name) == "jawOpen",
        lambda name: find_viseme(name) == "aa",
        lambda name: find_vowel(name) == "aa",
        lambda name: "open" in name.lower() and ("mouth" in name.lower() or "jaw" in name.lower()),
    )
    for test in tests:
        opening = [shape for shape in mesh.shapes if len(shape.rows) and test(shape.called)]
        if opening:  # of teeth and face that of the face
            return max(opening, key=lambda shape: len(shape.rows))
    names = shorten(", ".join(mesh.shape_names)) or "none"
    raise InputError(
        f"no blendshape opens the mouth, required jawOpen, viseme_aa or aa; the mesh has: {names}. Say which one "
        "does in a table beside the character, or name the lip points by their vertices (docs/meshes.md)"
    )


def _find_slit(vertices: Places, surface: MeshSurface, drop: Places, skin: NDArray[np.bool_]) -> Places:
    """Return points along the line where the lips meet: middles of pairs that go apart [shape=(N, 3)]."""
    moved = vertices[skin & (drop > 0.5)]
    reach = SLIT_REACH * float(np.ptp(moved[:, 0])) if len(moved) else 0.0
    low, high = np.flatnonzero(skin & (drop > SLIT_STEP)), np.flatnonzero(skin & (drop < 1 - SLIT_STEP))
    if not reach or not len(low) or not len(high):
        return np.zeros((0, 3))
    tree = _tree(vertices[high])
    count = int(tree.count_neighbors(_tree(vertices[low]), reach))
    crowd = 1 + max(count // MAX_PAIRS, len(low) * len(vertices) // MAX_DISTANCES)
    if crowd > 1:
        low = np.sort(np.random.default_rng(0).choice(low, -(-len(low) // crowd), replace=False))
    near = tree.query_ball_point(vertices[low], reach)
    others = high[np.fromiter(chain.from_iterable(near), np.int64)]
    pairs = np.stack([np.repeat(low, [len(each) for each in near]), others], axis=1)
    pairs = pairs[drop[pairs[:, 0]] - drop[pairs[:, 1]] > SLIT_STEP]
    far = np.zeros(len(pairs), bool)
    straight = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
    longest = np.maximum(DETOUR_RATIO * straight, reach / 2)
    sources, number = np.unique(pairs[:, 0], return_inverse=True)
    at_once = max(1, DISTANCES_AT_ONCE // len(vertices))
    for first in range(0, len(sources), at_once):
        along = surface.distances(sources[first : first + at_once], float(longest.max(initial=0.0)) + reach)
        here = (number >= first) & (number < first + at_once)
        far[here] = along[number[here] - first, pairs[here, 1]] > longest[here]
    pairs = pairs[far]
    middle = (vertices[pairs[:, 0]] + vertices[pairs[:, 1]]) / 2
    return middle[middle[:, 2] > _limit_depths(middle, reach / 4) - FRONT_SHARE * reach / SLIT_REACH]


def _limit_depths(places: Places, reach: float) -> Places:
    """Return the largest z of all places whose x is within a reach of that of each [shape=(N,)]."""
    order = np.argsort(places[:, 0], kind="stable")
    across = places[order, 0]
    first, stop = np.searchsorted(across, across - reach), np.searchsorted(across, across + reach, "right")
    doubled = [places[order, 2]]  # the largest of 1, 2, 4, ... that follow one another
    while 2 ** len(doubled) <= len(places):
        half = 2 ** (len(doubled) - 1)
        doubled.append(np.maximum(doubled[-1], np.append(doubled[-1][half:], np.full(half, -np.inf))))
    level = np.log2(np.maximum(stop - first, 1)).astype(int)
    table = np.stack(doubled)
    largest = np.empty(len(places))
    largest[order] = np.maximum(table[level, first], table[level, stop - 2**level])
    return largest


def _aim(scale: float, centre: Places, middle: Places) -> Places:
    """Return where the points should be where lips meet along ``middle``, right to left [shape=(52, 3)]."""
    template = build_mouth()
    targets = centre + scale * (template.places - template.centre)
    seam = np.interp(targets[:, 0], middle[:, 0], middle[:, 1])
    depth = np.interp(targets[:, 0], middle[:, 0], middle[:, 2])
    lips = ~template.jaw
    above = template.places[:, 1] - template.seam(template.places[:, 0])
    targets[lips, 1] = (seam + scale * above)[lips]
    targets[lips & template.inner, 2] = depth[lips & template.inner]
    return targets


def _choose_vertices(
    places: Places, forward: Places, targets: Places, skin: NDArray[np.bool_], upper: NDArray[np.bool_]
) -> Rows:
    """Return the vertex of each point: the nearest one of the skin on its side of the lips that faces forwards."""
    template, stretch = build_mouth(), np.array([1.0, 1.0, DEPTH_WEIGHT])
    facing = skin & (forward > 0.0)
    chosen = np.zeros(len(targets), np.int64)
    sides = ((template.upper, upper), (template.lower | template.jaw, ~upper), (template.corner, np.ones_like(upper)))
    for of_side, side in sides:
        for edge, candidates in ((template.inner, skin & side), (~template.inner, facing & side)):
            points, rows = of_side & edge, np.flatnonzero(candidates)
            if points.any():
                if not len(rows):
                    raise InputError(f"no vertices of one lip face forwards: {UPRIGHT}")
                chosen[points] = rows[_tree(places[rows] * stretch).query(targets[points] * stretch)[1]]
    return chosen


def _check_named(named: Mapping[int, int], vertices: int) -> None:
    points = build_mouth().points
    missing = [point for point in NEEDED if point not in named]
    if missing:
        raise InputError(
            f"the lip points {', '.join(map(str, missing))} are missing, required: 61 and 291 (right and left corner), "
            "13 and 14 (middles of the upper and lower inner lip)"
        )
    for point, vertex in named.items():
        if point not in points and point not in EYE_CORNERS:
            raise InputError(f"{point} is no lip or jaw point, required one of {', '.join(map(str, points))}")
        if not 0 <= vertex < vertices:
            raise InputError(f"the point {point} is vertex {vertex}, required 0 to {vertices - 1}")
    if len({named[point] for point in NEEDED}) < len(NEEDED):
        raise InputError("two of the points 61, 291, 13, 14 are one vertex; name four different ones")


def _tree(places: Places) -> Any:
    from scipy.spatial import cKDTree  # a tenth of a second, which those who only draw faces need not wait

    return cKDTree(places)
