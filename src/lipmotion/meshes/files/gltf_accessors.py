"""The arrays of a glTF document: accessors, also sparse, quantised or compressed ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.meshes.files.gltf_container import GltfDocument
from lipmotion.meshes.files.gltf_schema import COMPONENTS, COMPRESSION, LARGEST_NUMBER, WIDTHS
from lipmotion.meshes.files.meshopt import decoded_attributes, decoded_exponents, decoded_indices, decoded_triangles
from lipmotion.meshes.model.file_limits import Budget


class GltfArrays:
    """Reads the accessors of a document; a compressed view is decoded once."""

    def __init__(self, document: GltfDocument) -> None:
        self._document = document
        self._decoded: dict[int, memoryview] = {}

    def count(self, number: int) -> int:
        """Return the number of elements of an accessor, as the document says."""
        return int(self._document.items("accessors")[number]["count"])

    def floats(self, number: int, width: int, count: int | None = None) -> NDArray[np.float64]:
        """Return an accessor as numbers [shape=(N, width)]; normalised whole numbers become -1 to 1 or 0 to 1.

        count : the elements that it must have; None: any
        Raises InputError: it has another width or count, it leads out of its buffer, or values are not finite.
        """
        raw = self._raw(number, width, count)
        with np.errstate(invalid="ignore"):  # signalling NaN; refused below
            values = raw.astype(np.float64)
        if self._document.items("accessors")[number].get("normalized") and raw.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(raw.dtype).max, -1.0)
        if not (np.abs(values) <= LARGEST_NUMBER).all():
            raise InputError(f"it has numbers that are not finite, or beyond ±{LARGEST_NUMBER:g}; export it again")
        return values

    def whole(self, number: int, width: int, count: int | None = None) -> NDArray[np.int64]:
        """Return an accessor of whole numbers [shape=(N, width)]. Raises InputError: as ``floats``, or of fractions."""
        raw = self._raw(number, width, count)
        if raw.dtype.kind not in "iu":
            raise InputError("it counts vertices in fractions; export it again")
        return raw.astype(np.int64)

    def bytes_of(self, number: int) -> memoryview:
        """Return the bytes of a buffer view. Raises InputError: it leads out of its buffer."""
        return self._view(number)[0]

    def _raw(self, number: int, width: int, wanted: int | None) -> NDArray[Any]:
        accessor = self._document.items("accessors")[number]
        count, kind = accessor["count"], accessor["type"]
        if WIDTHS[kind] != width:
            raise InputError(f"an array of {kind}, required {width} numbers each; export it again")
        if wanted is not None and count != wanted:
            raise InputError(f"an array of {count} elements, required {wanted}; export it again")
        self._document.budget.spend("numbers", count * width)
        dtype = np.dtype(COMPONENTS[accessor["componentType"]])
        values = self._elements(accessor, dtype, count, width)
        return self._with_sparse(values, accessor["sparse"]) if "sparse" in accessor else values

    def _elements(self, place: dict[str, Any], dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Return what an accessor, or a part of a sparse one, places in a view; zeros if it names none."""
        if "bufferView" not in place:
            return np.zeros((count, width), dtype)
        data, stride = self._view(place["bufferView"])
        offset, size = place.get("byteOffset", 0), dtype.itemsize * width
        stride = stride or size
        if stride < size or (count and offset + (count - 1) * stride + size > len(data)):
            raise InputError(
                f"an array of {count} elements of {size} bytes leads out of its {len(data)} bytes; export it again"
            )
        if not count:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def _with_sparse(self, values: NDArray[Any], sparse: dict[str, Any]) -> NDArray[Any]:
        count, indices = sparse["count"], sparse["indices"]
        if count > len(values):
            raise InputError(f"a sparse array changes {count} of {len(values)} elements; export it again")
        where = self._elements(indices, np.dtype(COMPONENTS[indices["componentType"]]), count, 1)[:, 0]
        if count and where.max() >= len(values):
            raise InputError("a sparse array that leads out of its array; export it again")
        changed = values.copy()
        changed[where] = self._elements(sparse["values"], values.dtype, count, values.shape[1])
        return changed

    def _view(self, number: int) -> tuple[memoryview, int]:
        """Return the bytes of a buffer view, and the distance of its elements (0: none apart)."""
        view = self._document.items("bufferViews")[number]
        packed = next((view["extensions"][name] for name in COMPRESSION if name in view.get("extensions", {})), None)
        if packed is None:
            return self._slice(view), view.get("byteStride", 0)
        if number not in self._decoded:
            self._decoded[number] = memoryview(_decoded(self._slice(packed), packed, self._document.budget))
        return self._decoded[number], packed["byteStride"]

    def _slice(self, view: dict[str, Any]) -> memoryview:
        number, offset, length = view["buffer"], view.get("byteOffset", 0), view["byteLength"]
        buffer = self._document.buffers.get(number, memoryview(b""))
        if offset + length > len(buffer):
            raise InputError(
                f"it refers to bytes {offset} to {offset + length} of buffer {number} with {len(buffer)} bytes; "
                "copy it again, with its buffers"
            )
        return buffer[offset : offset + length]


def _decoded(data: memoryview, packed: dict[str, Any], budget: Budget) -> bytes:
    count, stride, mode, kind = packed["count"], packed["byteStride"], packed["mode"], packed.get("filter", "NONE")
    budget.spend("compressed bytes", count * stride + len(data))
    if kind not in {"NONE", "EXPONENTIAL"}:
        raise InputError(f"a compressed array under the filter {shorten(kind)!r}, which is not read")
    if mode == "ATTRIBUTES":
        elements = decoded_attributes(bytes(data), count, stride)
        return decoded_exponents(elements).tobytes() if kind == "EXPONENTIAL" else elements.tobytes()
    if stride not in {2, 4}:
        raise InputError(f"compressed indices of {stride} bytes, required 2 or 4; export without compression")
    indices = (decoded_triangles if mode == "TRIANGLES" else decoded_indices)(bytes(data), count)
    return indices.astype("<u2" if stride == 2 else "<u4").tobytes()
