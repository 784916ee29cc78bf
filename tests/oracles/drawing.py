"""Twins of ``lipmotion_faces.kernels``: triangles, light, bands of paint and pictures, for all samples at once."""

import math

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels import textured
from lipmotion_faces.kernels.painting import Floats, Layer
from lipmotion_faces.kernels.raster import GRID
from lipmotion_faces.kernels.shading import MIN_FACING_COSINE

Real = NDArray[np.float64]
Colours = NDArray[np.float32]
Samples = tuple[int, int, int, int]


def draw(
    points: Real,
    colours: Colours,
    triangles: NDArray[np.int32],
    area: tuple[int, int, int, int],
    background: Colours,
    tone: NDArray[np.uint8],
    picture: NDArray[np.uint8],
) -> None:
    """Draw as ``lipmotion_faces.kernels.raster.draw`` says."""
    corners, z = np.rint(2 * GRID * points[:, :2]) / GRID, points[:, 2]
    left, top, right, bottom = area
    light = np.repeat(np.repeat(background[top:bottom, left:right], 2, axis=0), 2, axis=1)
    depth = np.full(light.shape[:2], np.inf, np.float32)
    samples = (2 * left, 2 * top, 2 * right, 2 * bottom)
    for a, c, b in triangles.tolist():  # clockwise on the screen, whose rows go down
        _triangle(corners[[a, b, c]], z[[a, b, c]], colours[[a, b, c]], samples, depth, light)
    total = np.zeros((bottom - top, right - left, 3), np.float32)
    for row in range(2):
        for column in range(2):
            total += light[row::2, column::2]
    level = np.clip(np.float32(0.25) * total, 0, 1) * np.float32(len(tone) - 1)
    picture[top:bottom, left:right] = tone[level.astype(int)]


def _triangle(corner: Real, z: Real, colour: Colours, samples: Samples, depth: Colours, light: Colours) -> None:
    if (covered := _cover(corner, samples)) is None:
        return
    window, inside, of_b, of_c = covered
    share_b, share_c = of_b.astype(np.float32), of_c.astype(np.float32)
    away = np.float32(z[0]) + (share_b * np.float32(z[1] - z[0]) + share_c * np.float32(z[2] - z[0]))
    seen = inside & (away < depth[window])
    depth[window][seen] = away[seen]
    shares = share_b[seen, None] * (colour[1] - colour[0]) + share_c[seen, None] * (colour[2] - colour[0])
    light[window][seen] = colour[0] + shares


def _cover(corner: Real, samples: Samples) -> tuple[tuple[slice, slice], NDArray[np.bool_], Real, Real] | None:
    """Return the samples around a triangle, which it covers, and its second and third weight; None: nothing is seen."""
    (xa, ya), (xb, yb), (xc, yc) = corner.tolist()
    twice_area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
    x0, x1 = max(samples[0], int(np.floor(corner[:, 0].min()))), min(samples[2], int(np.ceil(corner[:, 0].max())))
    y0, y1 = max(samples[1], int(np.floor(corner[:, 1].min()))), min(samples[3], int(np.ceil(corner[:, 1].max())))
    if twice_area <= 0 or x0 >= x1 or y0 >= y1:
        return None
    px, py = np.arange(x0, x1)[None] + 0.5, np.arange(y0, y1)[:, None] + 0.5
    of_a = (xc - xb) * (py - yb) - (yc - yb) * (px - xb)
    of_b = (xa - xc) * (py - yc) - (ya - yc) * (px - xc)
    of_c = (xb - xa) * (py - ya) - (yb - ya) * (px - xa)
    inside = (of_a >= bias(xb, yb, xc, yc)) & (of_b >= bias(xc, yc, xa, ya)) & (of_c >= bias(xa, ya, xb, yb))
    window = slice(y0 - samples[1], y1 - samples[1]), slice(x0 - samples[0], x1 - samples[0])
    inverse = 1.0 / twice_area
    return window, inside, of_b * inverse, of_c * inverse


def bias(xa: float, ya: float, xb: float, yb: float) -> float:
    """Return the least edge function of samples inside: samples on an edge belong to the triangle on one side of it."""
    return 0.0 if ya > yb or (ya == yb and xa < xb) else 1e-6


Whole = NDArray[np.int32]
Triple = tuple[Real, Real, Real]


def draw_textured(
    points: Real,
    light: Colours,
    shine: Colours,
    surface: textured.TexturedTriangles,
    area: tuple[int, int, int, int],
    background: Colours,
    tone: NDArray[np.uint8],
    picture: NDArray[np.uint8],
    opacity: NDArray[np.uint8],
) -> None:
    """Draw as ``lipmotion_faces.kernels.textured.draw_textured`` says."""
    points = np.column_stack([np.rint(2 * GRID * points[:, :2]) / GRID, points[:, 2]])
    left, top, right, bottom = area
    samples = (2 * left, 2 * top, 2 * right, 2 * bottom)
    size = samples[3] - samples[1], samples[2] - samples[0]
    shown, before = np.full(size, textured.NO_TRIANGLE, np.int32), np.full(size, textured.NO_TRIANGLE, np.int32)
    depth, near = np.full(size, np.inf, np.float32), np.full(size, np.inf, np.float32)
    planes = _planes(points, light, shine, surface)
    for number in range(len(surface.triangles)):
        _mark(number, points, planes, surface, samples, depth, shown, depth, False)
    for number in np.flatnonzero(surface.looks[:, 1] == textured.CLEAR).tolist():
        _mark(number, points, planes, surface, samples, near, before, depth, True)
    ids = [shown[row::2, column::2] for row in range(2) for column in range(2)]
    layers = [before[row::2, column::2] for row in range(2) for column in range(2)]
    total, covered = [], []
    for k in range(4):
        colour = background[top:bottom, left:right].astype(np.float64)
        hidden = np.zeros(colour.shape[:2])
        for marks, solid in ((ids, True), (layers, False)):
            seen = marks[k] != textured.NO_TRIANGLE
            place = _middle(marks, k, left, top)
            look = _shaded(marks[k][seen], place[seen], planes, surface)
            alpha = np.ones(len(look)) if solid else look[:, 3]
            colour[seen] = alpha[:, None] * look[:, :3] + (1.0 - alpha)[:, None] * colour[seen]
            hidden[seen] = alpha + (1.0 - alpha) * hidden[seen]
        total.append(colour)
        covered.append(hidden)
    mean = 0.25 * ((total[0] + total[1]) + (total[2] + total[3]))
    level = np.minimum(np.maximum(mean, 0.0), 1.0) * (len(tone) - 1)
    picture[top:bottom, left:right] = tone[level.astype(int)]
    hidden = (covered[0] + covered[1]) + (covered[2] + covered[3])
    opacity[top:bottom, left:right] = (63.75 * hidden + 0.5).astype(np.uint8)


def _middle(marks: list[Whole], k: int, left: int, top: int) -> Real:
    """Return the middle of the samples of each pixel that show the same triangle as sample k [shape=(H, W, 2)]."""
    rows, columns = np.indices(marks[k].shape)
    total, count = np.zeros((*marks[k].shape, 2)), np.zeros(marks[k].shape)
    for other in range(4):
        same = marks[other] == marks[k]
        total[..., 0] += np.where(same, 2 * (columns + left) + other % 2 + 0.5, 0.0)
        total[..., 1] += np.where(same, 2 * (rows + top) + other // 2 + 0.5, 0.0)
        count += same
    return total / count[..., None]


def _mark(
    number: int,
    points: Real,
    planes: Real,
    surface: textured.TexturedTriangles,
    samples: Samples,
    depth: Colours,
    marks: Whole,
    solid: Colours,
    blended: bool,
) -> None:
    a, c, b = surface.triangles[number].tolist()  # clockwise on the screen, whose rows go down
    if (covered := _cover(points[[a, b, c], :2], samples)) is None:
        return
    window, inside, of_b, of_c = covered
    za, zb, zc = points[[a, b, c], 2].tolist()
    away = (za + (of_b * (zb - za) + of_c * (zc - za))).astype(np.float32)
    seen = inside & (away < depth[window]) & (away <= solid[window])
    kind = surface.looks[number, 1]
    if kind != textured.SOLID and seen.any():
        cut, factor = surface.alphas[number]
        least = textured.SEEN_OPACITY if blended else cut if kind == textured.CUT else textured.HIDING_OPACITY
        rows, columns = np.nonzero(seen)
        first = window[1].start + samples[0] + 0.5, window[0].start + samples[1] + 0.5
        places = np.stack([columns + first[0], rows + first[1]], axis=1)
        alpha = _texel(np.full(len(places), number), places, planes, surface)[:, 3]
        seen[rows, columns] = alpha >= least / max(factor, 1e-9)
    depth[window][seen] = away[seen]
    marks[window][seen] = number


def _planes(points: Real, light: Colours, shine: Colours, surface: textured.TexturedTriangles) -> Real:
    """Return light, highlights, depth, and place in the texture times depth, as linear functions of the place on the
    screen: values at the origin, changes to the right and down [shape=(F, 9, 3)].
    """
    a, b, c = surface.triangles[:, 0], surface.triangles[:, 2], surface.triangles[:, 1]
    xa, ya, xb, yb, xc, yc = (points[rows, axis] for rows in (a, b, c) for axis in range(2))
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles without area are not drawn
        inverse = 1.0 / ((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya))
        bx, by, cx, cy = (yc - ya) * inverse, (xa - xc) * inverse, (ya - yb) * inverse, (xb - xa) * inverse
        b0, c0 = -(bx * xc + by * yc), -(cx * xa + cy * ya)
        planes = []
        for values in (light, shine):
            for channel in range(3):
                corners = [values[rows, channel].astype(np.float64) for rows in (a, b, c)]
                planes.append(_plane(corners, (b0, bx, by), (c0, cx, cy)))
        z = [points[rows, 2] for rows in (a, b, c)]
        planes.append(_plane(z, (b0, bx, by), (c0, cx, cy)))
        for axis in range(2):
            corners = [depth * surface.uv[:, corner, axis] for depth, corner in zip(z, (0, 2, 1), strict=True)]
            planes.append(_plane(corners, (b0, bx, by), (c0, cx, cy)))
    return np.stack(planes, axis=1)


def _plane(corners: list[Real], of_b: Triple, of_c: Triple) -> Real:
    first, second, third = corners
    to_b, to_c = second - first, third - first
    origin = first + (of_b[0] * to_b + of_c[0] * to_c)
    return np.stack([origin, of_b[1] * to_b + of_c[1] * to_c, of_b[2] * to_b + of_c[2] * to_c], axis=1)


def _on_plane(planes: Real, ids: Whole, number: int, places: Real) -> Real:
    at = planes[ids, number]
    return np.asarray(at[:, 0] + (at[:, 1] * places[:, 0] + at[:, 2] * places[:, 1]))


def _shaded(ids: Whole, places: Real, planes: Real, surface: textured.TexturedTriangles) -> Real:
    """Return light and opacity of triangles at places on the screen [shape=(N, 4)]."""
    result = _texel(ids, places, planes, surface)
    for channel in range(3):
        arrives = _on_plane(planes, ids, channel, places)
        result[:, channel] = result[:, channel] * arrives + _on_plane(planes, ids, 3 + channel, places)
    result[:, 3] *= surface.alphas[ids, 1]
    return result


def _texel(ids: Whole, places: Real, planes: Real, surface: textured.TexturedTriangles) -> Real:
    """Return the texture of triangles at places on the screen [shape=(N, 4)]: 0 to 1; 1 where there is none."""
    near = 1.0 / _on_plane(planes, ids, 6, places)
    row = surface.looks[ids, 0]
    first, width, height = surface.levels[row].T
    x = _on_plane(planes, ids, 7, places) * near * width - 0.5
    y = _on_plane(planes, ids, 8, places) * near * height - 0.5
    left, top = np.floor(x), np.floor(y)
    right_share, low_share = x - left, y - top
    column, line = left.astype(np.int64) % width, top.astype(np.int64) % height
    next_column, next_line = (column + 1) % width, (line + 1) % height
    result = np.ones((len(ids), 4))
    for channel in range(4):
        one, two, three, four = (
            surface.texels[first + at_line * width + at_column, channel].astype(np.float64)
            for at_line in (line, next_line)
            for at_column in (column, next_column)
        )
        upper = one + right_share * (two - one)
        lower = three + right_share * (four - three)
        result[:, channel] = (upper + low_share * (lower - upper)) * textured.SCALE
    result[row < 0] = 1.0
    return result


def shade(
    normals: Real, places: Real, viewer: Real, colours: Real, reaches: Real, strands: Real,
    kinds: NDArray[np.intp], finishes: Real, lamps: Real,
) -> NDArray[np.float32]:  # fmt: skip
    """Return what ``lipmotion_faces.kernels.shading.shade`` says, for all vertices at once."""
    finish = finishes[kinds]
    eye = viewer - places
    eye = eye / np.sqrt(_dot(eye, eye))[:, None]
    faces = _dot(normals, eye)
    grazing = np.minimum(np.maximum(1.0 - faces, 0.0), 1.0)
    grazing2 = grazing * grazing
    open_sky, direct = reaches[:, 0], reaches[:, 1]
    up = 0.5 + 0.5 * normals[:, 1]
    diffuse = [_bounced(open_sky, colours[:, c]) * (up * lamps[4, c] + (1.0 - up) * lamps[5, c]) for c in range(3)]
    edge = finish[:, 5] * grazing2 * grazing2 * open_sky
    shine = [edge * lamps[4, c] for c in range(3)]
    for n in range(2):
        towards, arrives = lamps[n, :3], direct if n == 0 else open_sky
        facing = _dot(normals, towards[None])
        half = eye + towards
        length = np.sqrt(_dot(half, half))
        along = _dot(strands, half) / length
        across = np.where(
            finish[:, 6] > 0, np.sqrt(np.maximum(1.0 - along * along, 0)), np.maximum(_dot(normals, half) / length, 0)
        )
        for step in range(int(finish[:, 4].max(initial=0))):
            across = np.where(step < finish[:, 4], across * across, across)
        glint = finish[:, 3] * across * np.minimum(np.maximum(4.0 * facing + 0.3, 0.0), 1.0) * arrives
        for c in range(3):
            soft = np.maximum(facing + finish[:, c], 0.0) / (1.0 + finish[:, c])
            diffuse[c] = diffuse[c] + soft * np.sqrt(soft) * _bounced(arrives, colours[:, c]) * lamps[n, 3 + c]
            glare = glint * lamps[n, 3 + c]
            glare = np.where(finish[:, 6] > 0, glare * (4.0 * colours[:, c]), glare)
            shine[c] = shine[c] + np.where(finish[:, 3] > 0, glare, 0.0)
    for n in range(2, 4):
        rim = np.maximum(_dot(normals, lamps[n, None, :3]), 0.0) * grazing2 * open_sky
        for c in range(3):
            diffuse[c] = diffuse[c] + 0.9 * rim * lamps[n, 3 + c]
            shine[c] = shine[c] + 0.12 * rim * lamps[n, 3 + c]
    light = np.stack([colours[:, c] * diffuse[c] + shine[c] for c in range(3)], axis=1)
    light[faces < MIN_FACING_COSINE] = 0
    return light.astype(np.float32)


def _bounced(arrives: Real, colour: Real) -> Real:
    """Return the light that arrives together with what the surface near by sends on, in its own colour."""
    return arrives * (1.0 + colour * (1.0 - arrives))


def _dot(a: Real, b: Real) -> Real:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def paint_band(layer: Layer, top: Floats, bottom: Floats, across: Floats, texture: Floats) -> None:
    row = np.arange(len(layer))[:, None].astype(np.float64)
    cover = np.zeros(layer.shape[:2])
    for upper, lower in zip(top, bottom, strict=True):
        cover += np.maximum(np.minimum(lower, row + 1) - np.maximum(upper, row), 0)
    cover = cover / len(top)
    start, end = top[0].copy(), bottom[0].copy()
    for upper, lower in zip(top[1:], bottom[1:], strict=True):
        start += upper
        end += lower
    start, end = start / len(top), end / len(top)
    depth = np.minimum(np.maximum((row + 0.5 - start) / np.maximum(end - start, 1e-3), 0), 1)
    down, beside = depth * (texture.shape[0] - 1), across * (texture.shape[1] - 1)
    d0 = np.minimum(down.astype(np.int64), max(texture.shape[0] - 2, 0))
    u0 = np.minimum(beside.astype(np.int64), max(texture.shape[1] - 2, 0))
    d1, u1 = np.minimum(d0 + 1, texture.shape[0] - 1), np.minimum(u0 + 1, texture.shape[1] - 1)
    fd, fu = (down - d0)[..., None], (beside - u0)[:, None]
    upper_row = texture[d0, u0] + fu * (texture[d0, u1] - texture[d0, u0])
    lower_row = texture[d1, u0] + fu * (texture[d1, u1] - texture[d1, u0])
    texel = upper_row + fd * (lower_row - upper_row)
    opacity = cover * texel[..., 3]
    texel[..., 3] = 1
    layer += (opacity[..., None] * (texel - layer)).astype(np.float32)


A = -0.5
"""Parameter of cubic convolution (Keys 1981)."""


def kernel(distance: float, kind: str) -> float:
    """Return the weight of a pixel at a distance along one side."""
    distance = abs(distance)
    if kind == "linear":
        return max(0.0, 1 - distance)
    if distance <= 1:
        return (A + 2) * distance**3 - (A + 3) * distance**2 + 1
    if distance < 2:
        return A * distance**3 - 5 * A * distance**2 + 8 * A * distance - 4 * A
    return 0.0


def value(picture: np.ndarray, x: float, y: float, kind: str) -> np.ndarray:
    """Return the colours at a position; outside the picture its outermost pixels repeat."""
    height, width = picture.shape[:2]
    total = np.zeros(picture.shape[2:])
    for row in range(math.floor(y) - 2, math.floor(y) + 4):
        for column in range(math.floor(x) - 2, math.floor(x) + 4):
            pixel = picture[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            total = total + kernel(x - column, kind) * kernel(y - row, kind) * pixel.astype(float)
    return total


def resample(picture: np.ndarray, to_source: np.ndarray, size: tuple[int, int], kind: str) -> np.ndarray:
    """Return the new picture [shape=(h, w, C)]."""
    new = np.empty((*size, picture.shape[2]))
    for row in range(size[0]):
        for column in range(size[1]):
            x, y = to_source @ [column, row, 1]
            new[row, column] = value(picture, x, y, kind)
    return new


def blended(part: np.ndarray, patch: np.ndarray, weight: np.ndarray, to_patch: np.ndarray, kind: str) -> np.ndarray:
    """Return a part of a frame with the patch blended in, before rounding."""
    new = resample(patch, to_patch, part.shape[:2], kind)
    share = resample(weight[..., None], to_patch, part.shape[:2], "linear")
    return np.clip(part + share * (new - part), 0, 255)
