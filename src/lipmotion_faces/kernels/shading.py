"""Light on vertices, and their normals, which a scene that is written once computes without waiting for numba."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled, pays

Real = NDArray[np.float64]
MIN_FACING_COSINE = -0.35  # vertices that face further away than this (the cosine) are not seen, and stay dark


@compiled
def shade(
    normals: Real, places: Real, viewer: Real, colours: Real, reaches: Real, strands: Real,
    kinds: NDArray[np.intp], finishes: Real, lamps: Real,
) -> NDArray[np.float32]:  # fmt: skip
    """Return the light that vertices send to the viewer [shape=(V, 3)].

    normals, places : of the vertices, normals of length 1 [shape=(V, 3)];  viewer : his place [shape=(3,)]
    colours  : diffuse reflection of red, green and blue [shape=(V, 3)]
    reaches  : the parts of the sky and of the first lamp that are not hidden [shape=(V, 2)]
    strands  : directions of hair, of length 1 [shape=(V, 3)]
    kinds    : the row of ``finishes`` of every vertex [shape=(V,)]
    finishes : how far light reaches into the shade (red, green, blue); strength of highlights and how often their
               shape is squared; reflection at grazing angles; 1 where highlights run across strands [shape=(K, 7)]
    lamps    : direction and light of key, fill and two rim lights, then light of sky and ground [shape=(6, 6)]
    Powers are made by squaring.
    Source: Blinn 1977 (highlights), Kajiya & Kay 1989 (hair), half-Lambert with a width for each colour (skin).
    """
    light = np.empty(normals.shape, np.float32)
    for v in range(len(normals)):
        nx, ny, nz = normals[v]
        ex, ey, ez = viewer[0] - places[v, 0], viewer[1] - places[v, 1], viewer[2] - places[v, 2]
        far = np.sqrt(ex * ex + ey * ey + ez * ez)
        ex, ey, ez = ex / far, ey / far, ez / far
        faces = nx * ex + ny * ey + nz * ez
        if faces < MIN_FACING_COSINE:
            light[v] = 0.0
            continue
        grazing = min(max(1.0 - faces, 0.0), 1.0)
        grazing2 = grazing * grazing
        (open_sky, direct), finish = reaches[v], finishes[kinds[v]]
        up = 0.5 + 0.5 * ny
        cr, cg, cb = colours[v]
        red = _bounce(open_sky, cr) * (up * lamps[4, 0] + (1.0 - up) * lamps[5, 0])
        green = _bounce(open_sky, cg) * (up * lamps[4, 1] + (1.0 - up) * lamps[5, 1])
        blue = _bounce(open_sky, cb) * (up * lamps[4, 2] + (1.0 - up) * lamps[5, 2])
        edge = finish[5] * grazing2 * grazing2 * open_sky
        shine_r, shine_g, shine_b = edge * lamps[4, 0], edge * lamps[4, 1], edge * lamps[4, 2]
        for n in range(2):
            lx, ly, lz = lamps[n, 0], lamps[n, 1], lamps[n, 2]
            arrives = direct if n == 0 else open_sky
            facing = nx * lx + ny * ly + nz * lz
            red += _wrap(facing, finish[0]) * _bounce(arrives, cr) * lamps[n, 3]
            green += _wrap(facing, finish[1]) * _bounce(arrives, cg) * lamps[n, 4]
            blue += _wrap(facing, finish[2]) * _bounce(arrives, cb) * lamps[n, 5]
            if finish[3] > 0.0:
                hx, hy, hz = ex + lx, ey + ly, ez + lz
                length = np.sqrt(hx * hx + hy * hy + hz * hz)
                along = (strands[v, 0] * hx + strands[v, 1] * hy + strands[v, 2] * hz) / length
                glint = _compute_highlight(finish, (nx * hx + ny * hy + nz * hz) / length, along, facing) * arrives
                if finish[6] > 0.0:
                    shine_r += glint * lamps[n, 3] * (4.0 * cr)
                    shine_g += glint * lamps[n, 4] * (4.0 * cg)
                    shine_b += glint * lamps[n, 5] * (4.0 * cb)
                else:
                    shine_r += glint * lamps[n, 3]
                    shine_g += glint * lamps[n, 4]
                    shine_b += glint * lamps[n, 5]
        for n in range(2, 4):
            facing = max(nx * lamps[n, 0] + ny * lamps[n, 1] + nz * lamps[n, 2], 0.0)
            rim = facing * grazing2 * open_sky
            red += 0.9 * rim * lamps[n, 3]
            green += 0.9 * rim * lamps[n, 4]
            blue += 0.9 * rim * lamps[n, 5]
            shine_r += 0.12 * rim * lamps[n, 3]
            shine_g += 0.12 * rim * lamps[n, 4]
            shine_b += 0.12 * rim * lamps[n, 5]
        light[v, 0] = cr * red + shine_r
        light[v, 1] = cg * green + shine_g
        light[v, 2] = cb * blue + shine_b
    return light


@compiled
def _compute_highlight(finish: Real, normal: float, along: float, facing: float) -> float:
    across = np.sqrt(max(1.0 - along * along, 0.0)) if finish[6] > 0.0 else max(normal, 0.0)
    for _ in range(int(finish[4])):
        across = across * across
    return finish[3] * across * min(max(4.0 * facing + 0.3, 0.0), 1.0)


@compiled
def _bounce(arrives: float, colour: float) -> float:
    return arrives * (1.0 + colour * (1.0 - arrives))


@compiled
def _wrap(facing: float, wrap: float) -> float:
    soft = max(facing + wrap, 0.0) / (1.0 + wrap)
    return soft * np.sqrt(soft)


def sum_normals(places: Real, triangles: NDArray[np.int32]) -> Real:
    """Return the sum of the normals of the triangles around every vertex, twice as long as their areas [shape=(V, 3)].

    places : of the vertices [shape=(V, 3)];  triangles : counterclockwise from outside [shape=(F, 3)]
    Both forms give the same bits.
    """
    total = np.zeros(places.shape)
    if pays():
        _add_normals(places, triangles, total)
        return total
    first, second, third = (places[triangles[:, corner]] for corner in range(3))
    across = np.cross(second - first, third - first)
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(triangles[:, corner], across[:, axis], minlength=len(places))
    return total


@compiled
def _add_normals(places: Real, triangles: NDArray[np.int32], total: Real) -> None:
    """Add the normals of triangles to those of their vertices, corner after corner."""
    part = np.empty(total.shape)
    across = np.empty((len(triangles), 3))
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        bx, by, bz = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1], places[b, 2] - places[a, 2]
        cx, cy, cz = places[c, 0] - places[a, 0], places[c, 1] - places[a, 1], places[c, 2] - places[a, 2]
        across[f, 0], across[f, 1], across[f, 2] = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    for corner in range(3):
        part[:] = 0.0
        for f in range(len(triangles)):
            v = triangles[f, corner]
            part[v, 0] += across[f, 0]
            part[v, 1] += across[f, 1]
            part[v, 2] += across[f, 2]
        total += part
