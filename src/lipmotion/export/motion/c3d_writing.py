"""Writer of the binary format C3D: fractions of single precision, in Intel's order (``c3d_file`` reads)."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from lipmotion.export.motion.c3d_file import BLOCK, INTEL_PROCESSOR, MARK, MOST_FRAMES, OVERFLOW, C3dFile, Values


def write_c3d(path: Path, content: C3dFile) -> None:
    """Write a file; texts are ASCII, numbers have single precision.

    More frames than the header can number stand in ``TRIAL`` as two whole numbers each, and in ``POINT:LONG_FRAMES``.
    """
    frames, points = content.points.shape[:2]
    numbered = min(frames, MOST_FRAMES)
    curves = len(content.analog_labels)
    groups: dict[str, dict[str, int | float | Values]] = {
        "POINT": {
            "USED": points,
            "SCALE": -1.0,
            "RATE": content.rate_hz,
            "DATA_START": 0,
            "FRAMES": numbered,
            "LABELS": list(content.labels),
            "DESCRIPTIONS": ["" for _ in content.labels],
            "UNITS": [content.unit],
        },
        "ANALOG": {
            "USED": curves,
            "LABELS": list(content.analog_labels),
            "DESCRIPTIONS": ["" for _ in content.analog_labels],
            "GEN_SCALE": 1.0,
            "OFFSET": np.zeros(curves, np.int16),
            "SCALE": np.ones(curves, np.float32),
            "UNITS": list(content.analog_units),
            "RATE": content.rate_hz,
        },
        "MANUFACTURER": {"SOFTWARE": [content.software]},
    }
    if frames > numbered:
        groups["POINT"]["LONG_FRAMES"] = float(frames)
        start, end = (np.array([number % OVERFLOW, number // OVERFLOW]) for number in (1, frames))
        groups["TRIAL"] = {"ACTUAL_START_FIELD": start, "ACTUAL_END_FIELD": end}
    blocks = -(-(4 + len(_section(groups))) // BLOCK)
    groups["POINT"]["DATA_START"] = 2 + blocks
    section = bytes([1, MARK, blocks, INTEL_PROCESSOR]) + _section(groups)
    header = struct.pack("<BB5HfHHf", 2, MARK, points, curves, 1, numbered, 10, -1.0, 2 + blocks, 1, content.rate_hz)
    seen = np.isfinite(content.points).all(axis=2)
    data = np.zeros((frames, points * 4 + curves), "<f4")
    placed = np.concatenate([content.points, np.where(seen, 0.0, -1.0)[..., None]], axis=2)
    data[:, : points * 4] = np.nan_to_num(placed).reshape(frames, -1)
    if curves:
        data[:, points * 4 :] = content.analog
    with path.open("wb") as file:
        file.write(header.ljust(BLOCK, b"\0") + section.ljust(blocks * BLOCK, b"\0") + data.tobytes())
        file.write(b"\0" * (-data.nbytes % BLOCK))


def _section(groups: dict[str, dict[str, int | float | Values]]) -> bytes:
    """Return groups and parameters as bytes."""
    parts = []
    for number, (group, parameters) in enumerate(groups.items(), 1):
        parts.append(struct.pack("<bb", len(group), -number) + group.encode() + struct.pack("<hB", 3, 0))
        for name, value in parameters.items():
            body = _parameter(value) + b"\0"
            head = struct.pack("<bb", len(name), number) + name.encode()
            parts.append(head + struct.pack("<h", 2 + len(body)) + body)
    return b"".join(parts) + b"\0\0"


def _parameter(value: int | float | Values) -> bytes:
    """Return type, sizes and values of a parameter as bytes."""
    if isinstance(value, list):
        width = max((len(text.encode("ascii", "replace")) for text in value), default=0)
        texts = b"".join(text.encode("ascii", "replace").ljust(width) for text in value)
        return struct.pack("<bBBB", -1, 2, width, len(value)) + texts
    numbers = np.asarray(value)
    kind = "<u2" if numbers.dtype.kind == "i" else "<f4"
    sizes = bytes([numbers.ndim, *numbers.shape])
    return struct.pack("<b", 2 if kind == "<u2" else 4) + sizes + numbers.astype(kind).tobytes()
