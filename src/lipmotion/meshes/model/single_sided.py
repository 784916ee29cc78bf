"""Thin surfaces whose triangles are in a mesh twice, once for each side, as one surface seen from both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lipmotion.meshes.model.mesh import Mesh


def drop_back_sides(mesh: Mesh) -> Mesh:
    """Return a mesh in which parts that hold every triangle twice, the second time turned round, hold it once, and are
    seen from both sides.

    Lashes and leaves are often made so. The normals of the two sides would cancel out. The vertices stay as they are;
    so do parts of which some triangles alone are there twice.
    """
    corners = mesh.triangles.astype(np.int64)
    low, middle, high = np.sort(corners, axis=1).T
    _, of_pair = np.unique(low * len(mesh.vertices) + middle, return_inverse=True)
    _, same = np.unique(of_pair.reshape(-1) * len(mesh.vertices) + high, return_inverse=True)
    same = same.reshape(-1)
    first = np.full(int(same.max(initial=-1)) + 1, -1, np.int64)
    first[same[::-1]] = np.arange(len(corners))[::-1]
    partner = first[same]
    turned = (corners[:, 0] > corners[:, 1]) ^ (corners[:, 1] > corners[:, 2]) ^ (corners[:, 0] > corners[:, 2])
    back = turned != turned[partner]
    dropped = np.zeros(len(corners), bool)
    for part in mesh.parts:
        mine = slice(part.first, part.stop)
        backs = back[mine] & (partner[mine] >= part.first)
        if part.stop > part.first and 2 * backs.sum() == part.stop - part.first:
            dropped[mine] = backs
    if not dropped.any():
        return mesh
    kept = np.concatenate([[0], np.cumsum(~dropped)])
    parts = tuple(
        replace(
            part,
            first=int(kept[part.first]),
            stop=int(kept[part.stop]),
            material=replace(
                part.material, two_sided=part.material.two_sided or bool(dropped[part.first : part.stop].any())
            ),
        )
        for part in mesh.parts
    )
    uv = None if mesh.uv is None else mesh.uv[~dropped]
    return replace(mesh, triangles=mesh.triangles[~dropped], parts=parts, uv=uv)
