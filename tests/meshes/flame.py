"""Meshes with the vertices of FLAME, made up: only the vertices that are read have a place that means something."""

import numpy as np

from lipmotion_faces.corpus.captured_faces import FLAME_MARKERS, FLAME_VERTICES

FACE_MM = {
    **{"EYE_L": (45, 0, 0), "EYE_R": (-45, 0, 0), "NASION": (0, 10, 20), "LIP_0": (0, -54, 30), "LIP_13": (0, -60, 30)},
    **{"LIP_14": (0, -61, 30), "LIP_17": (0, -70, 30), "LIP_61": (-23, -60, 25), "LIP_291": (23, -60, 25)},
    "JAW_152": (0, -105, 20),
}
LOWER = ("LIP_14", "LIP_17", "JAW_152")


def head(jaw_mm: float, order: str) -> bytes:
    """Return a mesh with the vertices of FLAME at rest, its jaw lowered by some millimetres."""
    places = np.random.default_rng(0).normal(size=(FLAME_VERTICES, 3)) / 100
    for name, place in FACE_MM.items():
        places[FLAME_MARKERS[name]] = np.array(place) / 1000 - [0, jaw_mm / 1000 * (name in LOWER), 0]
    kind = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    faces = "element face 1\nproperty list uchar int vertex_indices\n"
    header = f"ply\nformat {kind} 1.0\ncomment made up\nelement vertex {FLAME_VERTICES}\n{axes}{faces}end_header\n"
    if not order:
        return (header + "\n".join(" ".join(map(repr, row)) for row in places.tolist()) + "\n3 0 1 2\n").encode()
    triangle = b"\3" + np.array([0, 1, 2], f"{order}i4").tobytes()
    return header.encode() + places.astype(f"{order}f4").tobytes() + triangle
