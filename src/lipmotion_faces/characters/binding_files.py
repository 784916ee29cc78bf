"""Files of bindings: the binding itself, and a table of weights that can be looked at and painted."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lipmotion.articulation.lip_points import build_mouth
from lipmotion.errors import InputError, ModelFormatError, shorten
from lipmotion.meshes.fitting.lip_placement import LipPlacement
from lipmotion.meshes.model.binding import MAX_WEIGHTS, ControlBinding
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.storage.archive import UNREADABLE, read_archive, read_header_of, write_archive
from lipmotion.storage.files import atomic_file
from lipmotion.storage.schema import ArraySpec, check_arrays, format_errors
from lipmotion.storage.sources import check_source
from lipmotion.storage.text_table import read_whole_table
from lipmotion.types.values import parse_whole
from lipmotion_faces.characters.file_limits import MAX_VERTICES

BINDING_FORMAT, BINDING_VERSION = "lipmotion.binding", 1
BINDING_SUFFIX = ".binding"
WEIGHT_COLUMNS = ("vertex", "point", "weight")
POINT_COLUMNS = ("point", "vertex")
LARGEST_TABLE_BYTES = 1 << 26
AGAIN = "bind the character again"
BINDING_ARRAYS = {
    "points": ArraySpec(np.int64, "C", 0, 1000),
    "vertices": ArraySpec(np.int64, "C", 0, MAX_VERTICES),
    "scale": ArraySpec(np.float64, "", 1e-12, 1e12),
    "axes": ArraySpec(np.float64, "3 3", -1.0001, 1.0001),
    "rows": ArraySpec(np.int64, "n", 0, MAX_VERTICES),
    "controls": ArraySpec(np.int64, "n K", 0, 1000),
    "weights": ArraySpec(np.float64, "n K", 0, 1),
    "vertex_count": ArraySpec(np.int64, "", 1, MAX_VERTICES),
}
"""The arrays of a binding file; fields of ``ControlBinding`` and ``LipPlacement``."""


def save_binding(path: Path, binding: ControlBinding, mesh: Mesh) -> None:
    """Write a binding of a mesh to a file. Raises ExportError: it cannot be written."""
    placement = binding.placement
    arrays = {
        "points": np.array(placement.points, np.int64),
        "vertices": placement.vertices,
        "scale": np.array(placement.scale),
        "axes": placement.axes,
        "rows": binding.rows,
        "controls": binding.controls,
        "weights": binding.weights,
        "vertex_count": np.array(len(mesh.vertices)),
    }
    write_archive(path, {"format": BINDING_FORMAT, "version": BINDING_VERSION}, arrays)


def load_binding(path: Path, mesh: Mesh) -> ControlBinding:
    """Return the binding of a file. Raises InputError: no file, or another mesh. Raises ModelFormatError: damaged."""
    check_source(path, "binding")
    read_header_of(path, BINDING_FORMAT, BINDING_VERSION, "binding", AGAIN)
    try:
        with format_errors(f"{path}: the binding", AGAIN):
            arrays = check_arrays(read_archive(path), BINDING_ARRAYS)
    except UNREADABLE as error:
        raise ModelFormatError(f"{path}: not a binding ({shorten(str(error))}); {AGAIN}") from error
    count = int(arrays["vertex_count"])
    if count != len(mesh.vertices):
        raise InputError(f"{path}: made for {count} vertices, the character has {len(mesh.vertices)}; bind it again")
    template = build_mouth()
    with format_errors(f"{path}: the binding", AGAIN):
        if tuple(arrays["points"].tolist()) != template.points:
            raise ValueError("its points are not those of motion")
        if max(arrays["vertices"].max(), arrays["rows"].max(initial=0)) >= count:
            raise ValueError("it names vertices that do not exist")
        if arrays["controls"].max(initial=0) >= len(template.points) or arrays["controls"].shape[1] > MAX_WEIGHTS:
            raise ValueError("it names control points that do not exist")
        if (np.diff(arrays["rows"]) <= 0).any() or arrays["weights"].sum(axis=1).max(initial=0.0) > 1 + 1e-6:
            raise ValueError("its vertices are not in order, or weights are more than 1")
    placement = LipPlacement(template.points, arrays["vertices"], float(arrays["scale"]), arrays["axes"])
    return ControlBinding(placement, arrays["rows"], arrays["controls"], arrays["weights"])


def write_weights(path: Path, binding: ControlBinding) -> None:
    """Write the weights as a table ``vertex,point,weight``. Raises ExportError: it cannot be written."""
    with atomic_file(path) as unfinished, unfinished.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(WEIGHT_COLUMNS) + "\n")
        for row, controls, weights in zip(binding.rows, binding.controls, binding.weights, strict=True):
            for control, weight in zip(controls.tolist(), weights.tolist(), strict=True):
                if weight > 0:
                    file.write(f"{row},{binding.placement.points[control]},{weight:.6g}\n")


def read_weights(path: Path) -> dict[int, dict[int, float]]:
    """Return a table of weights: for each vertex that it names, the weight of each point; for ``paint_weights``.

    A vertex that follows nothing has one row, with any point and weight 0.
    Raises InputError: no such file, other columns, a row that is damaged, or a vertex and point that occur twice.
    """
    paint: dict[int, dict[int, float]] = {}
    for number, row in _read_rows(path, WEIGHT_COLUMNS, "table of weights"):
        vertex, point = (parse_whole(text, f"{path}: line {number}: the number of a point is") for text in row[:2])
        weights = paint.setdefault(vertex, {})
        if point in weights:
            raise InputError(f"{path}: line {number}: vertex {vertex} and point {point} occur twice; remove one")
        try:
            weights[point] = float(row[2])
        except ValueError as error:
            raise InputError(f"{path}: line {number}: {shorten(row[2])!r} is no number") from error
    return paint


def write_points(path: Path, placement: LipPlacement) -> None:
    """Write the vertex of each lip and jaw point, ``point,vertex``. Raises ExportError: it cannot be written."""
    with atomic_file(path) as unfinished, unfinished.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(POINT_COLUMNS) + "\n")
        file.writelines(
            f"{point},{vertex}\n" for point, vertex in zip(placement.points, placement.vertices, strict=True)
        )


def read_points(path: Path) -> dict[int, int]:
    """Return the vertices of lip points from a table ``point,vertex``, for ``place_lips_by_points``.

    Raises InputError: no such file, other columns, a row that is damaged, or a point that occurs twice.
    """
    named: dict[int, int] = {}
    for number, row in _read_rows(path, POINT_COLUMNS, "table of lip points"):
        point, vertex = (parse_whole(text, f"{path}: line {number}: the number of a point is") for text in row)
        if point in named:
            raise InputError(f"{path}: line {number}: the point {point} occurs twice; remove one")
        named[point] = vertex
    return named


def _read_rows(path: Path, columns: tuple[str, ...], kind: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a table with their line numbers; empty lines and lines that begin with # are left out."""
    names, rows = read_whole_table(path, kind, LARGEST_TABLE_BYTES, columns)
    if names != list(columns):
        raise InputError(f"{path}: the columns are {shorten(','.join(names))!r}, required {','.join(columns)}")
    for line, row in rows:
        if not row[0].startswith("#"):
            if len(row) != len(columns):
                raise InputError(f"{path}: line {line}: {len(row)} columns, required {','.join(columns)}")
            yield line, row
