"""The arrays of a glTF document: accessors, also sparse, quantised or compressed ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.rig.gltf_container import GltfDocument
from lipmotion.rig.limits import MOST_TRIANGLES
from lipmotion.rig.meshopt import decoded_attributes, decoded_exponents, decoded_indices, decoded_triangles

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
COMPRESSION = ("EXT_meshopt_compression", "KHR_meshopt_compression")
LARGEST_NUMBER = 1e9
MOST_ELEMENTS = 3 * MOST_TRIANGLES


class GltfArrays:
    """Reads the accessors of a document; a compressed view is decoded once."""

    def __init__(self, document: GltfDocument) -> None:
        self._document = document
        self._decoded: dict[int, bytes] = {}

    def floats(self, number: Any, width: int) -> NDArray[np.float64]:
        """Return an accessor as numbers [shape=(N, width)]; normalised whole numbers become -1 to 1 or 0 to 1.

        Raises InputError: there is no such accessor, it has another width, it leads out of its buffer, or values are
        not finite.
        """
        accessor = self._document.item("accessors", number)
        raw = self._raw(accessor, width)
        with np.errstate(invalid="ignore"):  # signalling NaN; refused below
            values = raw.astype(np.float64)
        if accessor.get("normalized") is True and raw.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(raw.dtype).max, -1.0)
        if not (np.abs(values) <= LARGEST_NUMBER).all():
            raise InputError(f"it has numbers that are not finite, or beyond ±{LARGEST_NUMBER:g}; export it again")
        return values

    def whole(self, number: Any, width: int = 1) -> NDArray[np.int64]:
        """Return an accessor of whole numbers [shape=(N, width)]. Raises InputError: as ``floats``, or of fractions."""
        raw = self._raw(self._document.item("accessors", number), width)
        if raw.dtype.kind not in "iu":
            raise InputError("it counts vertices in fractions; export it again")
        return raw.astype(np.int64)

    def bytes_of(self, number: Any) -> bytes:
        """Return the bytes of a buffer view. Raises InputError: there is none, or it leads out of its buffer."""
        return self._view(number)[0]

    def _raw(self, accessor: dict[str, Any], width: int) -> NDArray[Any]:
        kind, count = COMPONENTS.get(accessor.get("componentType", 0)), _size(accessor, "count")
        if kind is None or WIDTHS.get(str(accessor.get("type"))) != width:
            raise InputError(
                f"an array of {accessor.get('type')!r} of {accessor.get('componentType')!r}, required {width} numbers "
                "each; export it again"
            )
        if count > MOST_ELEMENTS:
            raise InputError(f"an array of {count} elements, required at most {MOST_ELEMENTS}; reduce the mesh")
        dtype = np.dtype(kind)
        if "bufferView" in accessor:
            values = self._elements(accessor["bufferView"], _size(accessor, "byteOffset", 0), dtype, count, width)
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._with_sparse(values.copy(), accessor["sparse"])
        return values

    def _elements(self, view: Any, offset: int, dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        data, stride = self._view(view)
        size = dtype.itemsize * width
        stride = stride or size
        if stride < size or (count and offset + (count - 1) * stride + size > len(data)):
            raise InputError(
                f"an array of {count} elements of {size} bytes leads out of its {len(data)} bytes; export it again"
            )
        if not count:
            return np.zeros((0, width), dtype)
        shape, strides = (count, width), (stride, dtype.itemsize)
        return np.ndarray(shape, dtype, data, offset, strides)

    def _with_sparse(self, values: NDArray[Any], sparse: Any) -> NDArray[Any]:
        if not isinstance(sparse, dict):
            raise InputError("a sparse array that is no object; export it again")
        count, indices, given = _size(sparse, "count"), sparse.get("indices"), sparse.get("values")
        if not isinstance(indices, dict) or not isinstance(given, dict) or count > len(values):
            raise InputError("a sparse array that is damaged; export it again")
        dtype = np.dtype(COMPONENTS.get(indices.get("componentType", 0), "<f4"))
        where = self._elements(indices.get("bufferView"), _size(indices, "byteOffset", 0), dtype, count, 1)[:, 0]
        if dtype.kind not in "iu" or (count and not 0 <= where.min() <= where.max() < len(values)):
            raise InputError("a sparse array that leads out of its array; export it again")
        offset = _size(given, "byteOffset", 0)
        values[where] = self._elements(given.get("bufferView"), offset, values.dtype, count, values.shape[1])
        return values

    def _view(self, number: Any) -> tuple[bytes, int]:
        """Return the bytes of a buffer view, and the distance of its elements (0: none apart)."""
        view = self._document.item("bufferViews", number)
        stride = _size(view, "byteStride", 0)
        extensions = view.get("extensions", {})
        for name in COMPRESSION:
            if isinstance(extensions, dict) and isinstance(extensions.get(name), dict):
                packed = extensions[name]
                if number not in self._decoded:
                    self._decoded[number] = _decoded(self._slice(packed), packed)
                return self._decoded[number], _size(packed, "byteStride")
        return self._slice(view), stride

    def _slice(self, view: dict[str, Any]) -> bytes:
        number, offset, length = view.get("buffer"), _size(view, "byteOffset", 0), _size(view, "byteLength")
        self._document.item("buffers", number)
        buffer = self._document.buffers.get(int(str(number)), b"")
        if offset + length > len(buffer):
            raise InputError(
                f"it refers to bytes {offset} to {offset + length} of buffer {number} with {len(buffer)} bytes; "
                "copy it again, with its buffers"
            )
        return buffer[offset : offset + length]


def _decoded(data: bytes, packed: dict[str, Any]) -> bytes:
    count, stride, mode, kind = (
        _size(packed, "count"),
        _size(packed, "byteStride"),
        packed.get("mode"),
        packed.get("filter"),
    )
    if count > MOST_ELEMENTS or count * stride > 16 * MOST_ELEMENTS:
        raise InputError(f"a compressed array of {count} elements, required at most {MOST_ELEMENTS}; reduce the mesh")
    if kind not in {None, "NONE", "EXPONENTIAL"}:
        raise InputError(f"a compressed array under the filter {shortened(repr(kind))}, which is not read")
    if mode == "ATTRIBUTES":
        elements = decoded_attributes(data, count, stride)
        return decoded_exponents(elements).tobytes() if kind == "EXPONENTIAL" else elements.tobytes()
    if mode not in {"TRIANGLES", "INDICES"} or stride not in {2, 4}:
        raise InputError(f"compression of mode {shortened(repr(mode))}, which is not known; export without compression")
    indices = (decoded_triangles if mode == "TRIANGLES" else decoded_indices)(data, count)
    return indices.astype("<u2" if stride == 2 else "<u4").tobytes()


def _size(container: dict[str, Any], name: str, default: int | None = None) -> int:
    value = container.get(name, default)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise InputError(f"{name} is {shortened(repr(value))}, required a whole number; export it again")
    return value
