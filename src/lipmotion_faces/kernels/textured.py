"""Triangles with textures to pixels: what each sample shows is found first, and then shaded once a pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled
from lipmotion_faces.kernels.raster import BAND, FAR, GRID, compute_bias, narrow, sort_by_band

Real = NDArray[np.float64]
Light = NDArray[np.float32]
Ints = NDArray[np.int32]

SOLID, CUT, CLEAR = 0, 1, 2
"""Kinds of triangles: without holes; with holes where the texture is clear; blended with what is behind."""
HIDING_OPACITY = 0.95  # from this opacity on, a blended surface hides what is behind it
SEEN_OPACITY = 1 / 512  # below this opacity, it is not seen
NO_TRIANGLE = -1
SCALE = 1 / 65535
PLANES = 27
"""Linear numbers of a triangle: three each of light, highlights, depth, and place in the texture times depth."""


class TexturedTriangles(NamedTuple):
    """Triangles, and how their textures lie on them.

    triangles : counterclockwise from outside [shape=(F, 3)]
    uv        : place of every corner in the texture, v downwards, repeated beyond 0 to 1 [shape=(F, 3, 2)]
    looks     : the row of ``levels`` or -1 for no texture, and the kind: ``SOLID``, ``CUT``, ``CLEAR`` [shape=(F, 2)]
    alphas    : opacity below which there is a hole; factor of the texture's opacity [shape=(F, 2)]
    texels    : light that is reflected, and opacity, 0 to 65535 [shape=(N, 4)]
    levels    : first texel, width and height of each texture [shape=(L, 3)]
    """

    triangles: Ints
    uv: Real
    looks: Ints
    alphas: Real
    texels: NDArray[np.uint16]
    levels: NDArray[np.int64]


@compiled
def draw_textured(
    points: Real, light: Light, shine: Light, surface: TexturedTriangles, area: tuple[int, int, int, int],
    background: Light, tone: NDArray[np.uint8], picture: NDArray[np.uint8], opacity: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Draw triangles over the background into an area of a picture, in place.

    points  : column and row in pixels, and depth: -1 divided by the distance [shape=(V, 3)]
    light   : of every vertex, what a white surface sends to the viewer [shape=(V, 3)];  shine : its highlights, which
              have no colour of the surface [shape=(V, 3)]
    area    : first column and row, and the column and row behind the last ones
    background : light in every pixel [shape=(H, W, 3)]
    tone    : the grey level of light from 0 to 1, in even steps [shape=(L,)]
    picture : is changed in the area alone [shape=(H, W, 3)]
    opacity : becomes the part of each pixel that triangles hide, 0 to 255, in the area alone [shape=(H, W)]
    The nearest blended surface is seen before solid ones. A texture is sampled once a pixel and triangle, bilinearly.
    """
    x, y, z = np.rint(2 * GRID * points[:, 0]) / GRID, np.rint(2 * GRID * points[:, 1]) / GRID, points[:, 2].copy()
    triangles, uv, looks, alphas, texels, levels = surface
    left, top, right, bottom = area
    bands = (bottom - top + BAND - 1) // BAND
    faces, starts = sort_by_band(x, y, triangles, 2 * left, 2 * right, 2 * top, bands)
    planes = np.empty((len(triangles), PLANES))
    _fill_planes(faces, x, y, z, light, shine, triangles, uv, planes)
    size = (2 * BAND, 2 * (right - left))
    depth, near = np.empty(size, np.float32), np.empty(size, np.float32)
    shown, before = np.empty(size, np.int32), np.empty(size, np.int32)
    for band in range(bands):
        first = top + band * BAND
        last = min(first + BAND, bottom)
        depth[:], near[:], shown[:], before[:] = FAR, FAR, NO_TRIANGLE, NO_TRIANGLE
        layered = False
        for n in range(starts[band], starts[band + 1]):
            t = faces[n]
            a, c, b = triangles[t]
            layered = layered or looks[t, 1] == CLEAR
            lowest = alphas[t, 0] if looks[t, 1] == CUT else HIDING_OPACITY
            _mark(
                t, x[a], y[a], z[a], x[b], y[b], z[b], x[c], y[c], z[c], 2 * left, 2 * right, 2 * first, 2 * last,
                looks[t, 1] != 0, lowest / max(alphas[t, 1], 1e-9), planes, looks[t, 0], texels, levels, depth, shown,
                depth,
            )  # fmt: skip
        if layered:
            for n in range(starts[band], starts[band + 1]):
                t = faces[n]
                a, c, b = triangles[t]
                if looks[t, 1] == CLEAR:
                    _mark(
                        t, x[a], y[a], z[a], x[b], y[b], z[b], x[c], y[c], z[c],
                        2 * left, 2 * right, 2 * first, 2 * last,
                        True, SEEN_OPACITY / max(alphas[t, 1], 1e-9), planes, looks[t, 0], texels, levels, near, before,
                        depth,
                    )  # fmt: skip
        _resolve(
            shown, before, layered, planes, looks, alphas, texels, levels, background, tone, picture, opacity,
            left, right, first, last,
        )  # fmt: skip


@compiled
def _fill_planes(
    faces: Ints, x: Real, y: Real, z: Real, light: Light, shine: Light, triangles: Ints, uv: Real, planes: Real
) -> None:
    for n in range(len(faces)):
        t = faces[n]
        a, c, b = triangles[t]
        xa, ya, xb, yb, xc, yc = x[a], y[a], x[b], y[b], x[c], y[c]
        inverse = 1.0 / ((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya))
        bx, by, cx, cy = (yc - ya) * inverse, (xa - xc) * inverse, (ya - yb) * inverse, (xb - xa) * inverse
        b0, c0 = -(bx * xc + by * yc), -(cx * xa + cy * ya)
        for channel in range(3):
            for kind, values in ((0, light), (9, shine)):
                first = np.float64(values[a, channel])
                to_b, to_c = np.float64(values[b, channel]) - first, np.float64(values[c, channel]) - first
                at = kind + 3 * channel
                planes[t, at] = first + (b0 * to_b + c0 * to_c)
                planes[t, at + 1], planes[t, at + 2] = bx * to_b + cx * to_c, by * to_b + cy * to_c
        for number in range(3):
            first, second, third = z[a], z[b], z[c]
            if number > 0:
                first, second, third = (
                    first * uv[t, 0, number - 1], second * uv[t, 2, number - 1], third * uv[t, 1, number - 1]
                )  # fmt: skip
            to_b, to_c = second - first, third - first
            at = 18 + 3 * number
            planes[t, at] = first + (b0 * to_b + c0 * to_c)
            planes[t, at + 1], planes[t, at + 2] = bx * to_b + cx * to_c, by * to_b + cy * to_c


@compiled
def _mark(
    t: int, xa: float, ya: float, za: float, xb: float, yb: float, zb: float, xc: float, yc: float, zc: float,
    left: int, right: int, top: int, bottom: int, holes: bool, lowest: float, planes: Real, level: int,
    texels: NDArray[np.uint16], levels: NDArray[np.int64], depth: Light, marks: Ints, solid: Light,
) -> None:  # fmt: skip
    x0, x1 = max(left, int(np.ceil(min(xa, xb, xc) - 0.5))), min(right, int(np.floor(max(xa, xb, xc) + 0.5)))
    y0, y1 = max(top, int(np.ceil(min(ya, yb, yc) - 0.5))), min(bottom, int(np.floor(max(ya, yb, yc) + 0.5)))
    if x0 >= x1 or y0 >= y1:
        return  # between the middles of samples
    inverse = 1.0 / ((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya))
    bias_a, bias_b, bias_c = compute_bias(xb, yb, xc, yc), compute_bias(xc, yc, xa, ya), compute_bias(xa, ya, xb, yb)
    to_b, to_c = zb - za, zc - za
    step_a, step_b, step_c = yc - yb, ya - yc, yb - ya
    per_a, per_b, per_c = 1.0 / (step_a or 1.0), 1.0 / (step_b or 1.0), 1.0 / (step_c or 1.0)
    for row in range(y0, y1):
        px, py = x0 + 0.5, row + 0.5
        of_a = (xc - xb) * (py - yb) - step_a * (px - xb)
        of_b = (xa - xc) * (py - yc) - step_b * (px - xc)
        of_c = (xb - xa) * (py - ya) - step_c * (px - xa)
        enter, leave = narrow(0, x1 - x0, of_a - bias_a, step_a, per_a)
        enter, leave = narrow(enter, leave, of_b - bias_b, step_b, per_b)
        enter, leave = narrow(enter, leave, of_c - bias_c, step_c, per_c)
        of_b, of_c, i = of_b - enter * step_b, of_c - enter * step_c, row - top  # exact, as the corners are
        for j in range(x0 - left + enter, x0 - left + leave):
            away = np.float32(za + (of_b * inverse * to_b + of_c * inverse * to_c))
            if (
                away < depth[i, j]
                and away <= solid[i, j]
                and (not holes or _sample_alpha(t, j + left + 0.5, py, planes, level, texels, levels) >= lowest)
            ):
                depth[i, j] = away
                marks[i, j] = t
            of_b -= step_b
            of_c -= step_c


@compiled
def _sample_alpha(
    t: int, px: float, py: float, planes: Real, level: int, texels: NDArray[np.uint16], levels: NDArray[np.int64]
) -> float:
    if level < 0:
        return 1.0
    one, two, three, four, right, low = _find_texels(t, px, py, planes, level, levels)
    return _blend_texels(texels, one, two, three, four, 3, right, low)


@compiled
def _find_texels(
    t: int, px: float, py: float, planes: Real, level: int, levels: NDArray[np.int64]
) -> tuple[int, int, int, int, float, float]:
    """Return the four texels around a place of a triangle, and how far it is to the right and down between them."""
    near = 1.0 / _evaluate_plane(planes, t, 18, px, py)
    x = _evaluate_plane(planes, t, 21, px, py) * near * levels[level, 1] - 0.5
    y = _evaluate_plane(planes, t, 24, px, py) * near * levels[level, 2] - 0.5
    first, width, height = levels[level, 0], levels[level, 1], levels[level, 2]
    left, top = np.floor(x), np.floor(y)
    column, line = int(left) % width, int(top) % height
    next_column = column + 1 if column + 1 < width else 0
    next_line = line + 1 if line + 1 < height else 0
    upper, lower = first + line * width, first + next_line * width
    return upper + column, upper + next_column, lower + column, lower + next_column, x - left, y - top


@compiled
def _evaluate_plane(planes: Real, t: int, at: int, px: float, py: float) -> float:
    return planes[t, at] + (planes[t, at + 1] * px + planes[t, at + 2] * py)


@compiled
def _blend_texels(
    texels: NDArray[np.uint16], one: int, two: int, three: int, four: int, channel: int, right: float, low: float
) -> float:
    a, b = np.float64(texels[one, channel]), np.float64(texels[two, channel])
    c, d = np.float64(texels[three, channel]), np.float64(texels[four, channel])
    upper = a + right * (b - a)
    lower = c + right * (d - c)
    return (upper + low * (lower - upper)) * SCALE


@compiled
def _shade(
    t: int, px: float, py: float, planes: Real, level: int, texels: NDArray[np.uint16], levels: NDArray[np.int64]
) -> tuple[float, float, float, float]:
    """Return the light of a triangle at a place on the screen, and the opacity of its texture."""
    red, green, blue, alpha = 1.0, 1.0, 1.0, 1.0
    if level >= 0:
        one, two, three, four, right, low = _find_texels(t, px, py, planes, level, levels)
        red = _blend_texels(texels, one, two, three, four, 0, right, low)
        green = _blend_texels(texels, one, two, three, four, 1, right, low)
        blue = _blend_texels(texels, one, two, three, four, 2, right, low)
        alpha = _blend_texels(texels, one, two, three, four, 3, right, low)
    red = red * _evaluate_plane(planes, t, 0, px, py) + _evaluate_plane(planes, t, 9, px, py)
    green = green * _evaluate_plane(planes, t, 3, px, py) + _evaluate_plane(planes, t, 12, px, py)
    blue = blue * _evaluate_plane(planes, t, 6, px, py) + _evaluate_plane(planes, t, 15, px, py)
    return red, green, blue, alpha


@compiled
def _resolve(
    shown: Ints, before: Ints, layered: bool, planes: Real, looks: Ints, alphas: Real,
    texels: NDArray[np.uint16], levels: NDArray[np.int64],
    background: Light, tone: NDArray[np.uint8], picture: NDArray[np.uint8], opacity: NDArray[np.uint8],
    left: int, right: int, first: int, last: int,
) -> None:  # fmt: skip
    top_level = float(len(tone) - 1)
    colours, covered, ids = np.empty((4, 3)), np.empty(4), np.empty(4, np.int32)
    for row in range(first, last):
        i = 2 * (row - first)
        for column in range(left, right):
            j = 2 * (column - left)
            t = shown[i, j]
            uniform = t == shown[i, j + 1] and t == shown[i + 1, j] and t == shown[i + 1, j + 1]
            if uniform and layered:
                uniform = before[i, j] == NO_TRIANGLE and before[i, j + 1] == NO_TRIANGLE
                uniform = uniform and before[i + 1, j] == NO_TRIANGLE and before[i + 1, j + 1] == NO_TRIANGLE
            if uniform and t == NO_TRIANGLE:
                for channel in range(3):
                    picture[row, column, channel] = tone[
                        _quantise(np.float64(background[row, column, channel]), top_level)
                    ]
                opacity[row, column] = 0
                continue
            if uniform:
                red, green, blue, _ = _shade(t, 2 * column + 1.0, 2 * row + 1.0, planes, looks[t, 0], texels, levels)
                picture[row, column, 0] = tone[_quantise(red, top_level)]
                picture[row, column, 1] = tone[_quantise(green, top_level)]
                picture[row, column, 2] = tone[_quantise(blue, top_level)]
                opacity[row, column] = 255
                continue
            _mix(shown, before, layered, i, j, row, column, planes, looks, alphas, texels, levels, background, colours,
                 covered, ids)  # fmt: skip
            for channel in range(3):
                total = (colours[0, channel] + colours[1, channel]) + (colours[2, channel] + colours[3, channel])
                picture[row, column, channel] = tone[_quantise(0.25 * total, top_level)]
            hidden = (covered[0] + covered[1]) + (covered[2] + covered[3])
            opacity[row, column] = np.uint8(63.75 * hidden + 0.5)


@compiled
def _mix(
    shown: Ints, before: Ints, layered: bool, i: int, j: int, row: int, column: int, planes: Real, looks: Ints,
    alphas: Real, texels: NDArray[np.uint16], levels: NDArray[np.int64], background: Light,
    colours: Real, covered: Real, ids: Ints,
) -> None:  # fmt: skip
    """Fill in the colours of the four samples of a pixel [shape=(4, 3)], and how far each is covered [shape=(4,)]."""
    for k in range(4):
        covered[k] = 0.0
        for channel in range(3):
            colours[k, channel] = background[row, column, channel]
    for marks, layer in ((shown, False), (before, True)):
        if layer and not layered:
            continue
        for k in range(4):
            ids[k] = marks[i + k // 2, j + k % 2]
        for k in range(4):
            t = ids[k]
            if t == NO_TRIANGLE or _find_earlier(ids, k) != k:
                continue
            px, py = _find_middle(ids, k, row, column)
            red, green, blue, alpha = _shade(t, px, py, planes, looks[t, 0], texels, levels)
            alpha = alpha * alphas[t, 1] if layer else 1.0
            for other in range(k, 4):
                if ids[other] == t:
                    colours[other, 0] = alpha * red + (1.0 - alpha) * colours[other, 0]
                    colours[other, 1] = alpha * green + (1.0 - alpha) * colours[other, 1]
                    colours[other, 2] = alpha * blue + (1.0 - alpha) * colours[other, 2]
                    covered[other] = alpha + (1.0 - alpha) * covered[other]


@compiled
def _quantise(light: float, top_level: float) -> int:
    return int(min(max(light, 0.0), 1.0) * top_level)


@compiled
def _find_earlier(ids: Ints, k: int) -> int:
    """Return the first of the samples that show the same triangle as sample k."""
    for other in range(k):
        if ids[other] == ids[k]:
            return other
    return k


@compiled
def _find_middle(ids: Ints, k: int, row: int, column: int) -> tuple[float, float]:
    """Return the middle of the samples of a pixel that show the same triangle as sample k."""
    px, py, count = 0.0, 0.0, 0.0
    for other in range(4):
        if ids[other] == ids[k]:
            px += 2 * column + other % 2 + 0.5
            py += 2 * row + other // 2 + 0.5
            count += 1.0
    return px / count, py / count
