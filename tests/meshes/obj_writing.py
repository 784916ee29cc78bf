"""OBJ files that tests read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.model.mesh import Mesh
from lipmotion.storage.files import as_text


def write_obj(path: Path, mesh: Mesh, vertices: NDArray[np.float64] | None = None) -> None:
    """Write a mesh as an OBJ file, without blendshapes: give their result as ``vertices`` [shape=(V, 3)].

    Parts are written as objects, with their names.
    """
    places = mesh.vertices if vertices is None else vertices
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in places.tolist())
        if mesh.uv is not None:
            file.writelines(f"vt {u:.7g} {v:.7g}\n" for u, v in mesh.uv.reshape(-1, 2).tolist())
        for part in mesh.parts:
            file.write(f"o {_one_line(part.name)}\nusemtl {_one_line(part.material.name)}\n")
            for number in range(part.first, part.stop):
                corners = (mesh.triangles[number] + 1).tolist()
                textures = range(3 * number + 1, 3 * number + 4)
                words = [f"{v}/{t}" for v, t in zip(corners, textures, strict=True)] if mesh.uv is not None else corners
                file.write(f"f {' '.join(map(str, words))}\n")


def _one_line(text: str) -> str:
    return as_text(" ".join(text.split())).rstrip("\\") or "part"  # a backslash at the end continues the line
