"""Triangles to pixels by definition: a triangle at a time, all of its samples at once; with textures, too."""

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.kernels import textured
from lipmotion_faces.kernels.raster import GRID

Real = NDArray[np.float64]
Colours = NDArray[np.float32]


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


def _triangle(
    corner: Real, z: Real, colour: Colours, samples: tuple[int, int, int, int], depth: Colours, light: Colours
) -> None:
    (xa, ya), (xb, yb), (xc, yc) = corner.tolist()
    twice_area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
    x0, x1 = max(samples[0], int(np.floor(corner[:, 0].min()))), min(samples[2], int(np.ceil(corner[:, 0].max())))
    y0, y1 = max(samples[1], int(np.floor(corner[:, 1].min()))), min(samples[3], int(np.ceil(corner[:, 1].max())))
    if twice_area <= 0 or x0 >= x1 or y0 >= y1:
        return
    px, py = np.arange(x0, x1)[None] + 0.5, np.arange(y0, y1)[:, None] + 0.5
    of_a = (xc - xb) * (py - yb) - (yc - yb) * (px - xb)
    of_b = (xa - xc) * (py - yc) - (ya - yc) * (px - xc)
    of_c = (xb - xa) * (py - ya) - (yb - ya) * (px - xa)
    inside = (of_a >= bias(xb, yb, xc, yc)) & (of_b >= bias(xc, yc, xa, ya)) & (of_c >= bias(xa, ya, xb, yb))
    inverse = 1.0 / twice_area
    share_b, share_c = (of_b * inverse).astype(np.float32), (of_c * inverse).astype(np.float32)
    away = np.float32(z[0]) + (share_b * np.float32(z[1] - z[0]) + share_c * np.float32(z[2] - z[0]))
    window = slice(y0 - samples[1], y1 - samples[1]), slice(x0 - samples[0], x1 - samples[0])
    seen = inside & (away < depth[window])
    depth[window][seen] = away[seen]
    shares = share_b[seen, None] * (colour[1] - colour[0]) + share_c[seen, None] * (colour[2] - colour[0])
    light[window][seen] = colour[0] + shares


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
    samples: tuple[int, int, int, int],
    depth: Colours,
    marks: Whole,
    solid: Colours,
    blended: bool,
) -> None:
    a, c, b = surface.triangles[number].tolist()  # clockwise on the screen, whose rows go down
    (xa, ya, za), (xb, yb, zb), (xc, yc, zc) = points[[a, b, c]].tolist()
    x0, x1 = max(samples[0], int(np.floor(min(xa, xb, xc)))), min(samples[2], int(np.ceil(max(xa, xb, xc))))
    y0, y1 = max(samples[1], int(np.floor(min(ya, yb, yc)))), min(samples[3], int(np.ceil(max(ya, yb, yc))))
    if (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya) <= 0 or x0 >= x1 or y0 >= y1:
        return
    px, py = np.arange(x0, x1)[None] + 0.5, np.arange(y0, y1)[:, None] + 0.5
    of_a = (xc - xb) * (py - yb) - (yc - yb) * (px - xb)
    of_b = (xa - xc) * (py - yc) - (ya - yc) * (px - xc)
    of_c = (xb - xa) * (py - ya) - (yb - ya) * (px - xa)
    inside = (of_a >= bias(xb, yb, xc, yc)) & (of_b >= bias(xc, yc, xa, ya)) & (of_c >= bias(xa, ya, xb, yb))
    inverse = 1.0 / ((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya))
    away = (za + (of_b * inverse * (zb - za) + of_c * inverse * (zc - za))).astype(np.float32)
    window = slice(y0 - samples[1], y1 - samples[1]), slice(x0 - samples[0], x1 - samples[0])
    seen = inside & (away < depth[window]) & (away <= solid[window])
    kind = surface.looks[number, 1]
    if kind != textured.SOLID and seen.any():
        cut, factor = surface.alphas[number]
        least = textured.SEEN_OPACITY if blended else cut if kind == textured.CUT else textured.HIDING_OPACITY
        rows, columns = np.nonzero(seen)
        places = np.stack([px[0, columns], py[rows, 0]], axis=1)
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
