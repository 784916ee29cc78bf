"""Decoding of EXT_meshopt_compression, as gltfpack and glTF-Transform write it.

Source: the glTF extension EXT_meshopt_compression (Khronos vendor extension, 2021): modes ATTRIBUTES, TRIANGLES and
INDICES; of its filters, EXPONENTIAL.  Deviation: filters of normals and rotations are refused: no mesh needs them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Bytes = NDArray[np.uint8]
GROUP = 16
"""Elements of a group: one byte of each is packed together."""
LARGEST_BLOCK, BLOCK_BYTES = 256, 8192
ATTRIBUTES, TRIANGLES, INDICES = 0xA0, 0xE0, 0xD0
"""First byte of each kind of stream, before the version."""
ATTRIBUTE_TAIL, TRIANGLE_TAIL, INDEX_TAIL = 32, 16, 4
FIFO = 16
_DAMAGED = "its compressed data is damaged; export it again, without compression"


def decode_attributes(data: bytes, count: int, stride: int) -> Bytes:
    """Return a stream of vertex attributes [shape=(count, stride)]. Raises InputError: wrong version or length."""
    if not 0 < stride <= LARGEST_BLOCK or stride % 4:
        raise InputError(f"compressed elements of {stride} bytes, required a multiple of 4 up to 256")
    _check_header(data, ATTRIBUTES, (0,))
    tail = max(stride, ATTRIBUTE_TAIL)
    if len(data) < 1 + tail:
        raise InputError(_DAMAGED)
    baseline = np.frombuffer(data[-stride:], np.uint8)
    rows = min((BLOCK_BYTES // stride) & ~(GROUP - 1), LARGEST_BLOCK)
    result = np.empty((count, stride), np.uint8)
    position, end = 1, len(data) - tail
    for first in range(0, count, rows):
        block = result[first : first + rows]
        for column in range(stride):
            deltas, position = _unpack(data, position, end, len(block))
            steps = (deltas >> 1) ^ (0 - (deltas & 1))
            block[:, column] = np.cumsum(steps, dtype=np.uint8) + baseline[column]
        baseline = block[-1].copy()
    if position != end:
        raise InputError(_DAMAGED)
    return result


def _unpack(data: bytes, position: int, end: int, count: int) -> tuple[Bytes, int]:
    """Return the packed differences of one byte of a block [shape=(count,)], and where the data goes on."""
    groups = -(-count // GROUP)
    header = data[position : position + (groups + 3) // 4]
    position += (groups + 3) // 4
    values = np.zeros((groups, GROUP), np.uint8)
    for group in range(groups):
        mode = header[group // 4] >> (group % 4 * 2) & 3 if group // 4 < len(header) else 3
        if mode == 3:
            packed = data[position : position + GROUP]
            position += GROUP
            if position > end:
                raise InputError(_DAMAGED)
            values[group] = np.frombuffer(packed, np.uint8)
        elif mode:
            bits = 2 * mode
            packed_bits = int.from_bytes(data[position : position + 2 * bits], "big")
            position += 2 * bits
            escape = (1 << bits) - 1  # stands for a whole byte, which follows
            row = [packed_bits >> (bits * place) & escape for place in range(GROUP - 1, -1, -1)]
            for place, value in enumerate(row):
                if value == escape:
                    if position >= end:
                        raise InputError(_DAMAGED)
                    row[place] = data[position]
                    position += 1
            values[group] = row
    if position > end:
        raise InputError(_DAMAGED)
    return values.reshape(-1)[:count], position


def decode_exponents(elements: Bytes) -> NDArray[np.float32]:
    """Return the numbers of elements under the filter EXPONENTIAL: 24 bits of mantissa and 8 of exponent."""
    words = np.ascontiguousarray(elements).view("<i4")
    exponents = words >> 24
    mantissas = (words << 8) >> 8
    with np.errstate(over="ignore"):
        return np.ldexp(mantissas.astype(np.float32), exponents)


def decode_indices(data: bytes, count: int) -> NDArray[np.uint32]:
    """Return the vertices of a stream of indices [shape=(count,)]. Raises InputError: another version, or too short."""
    _check_header(data, INDICES, (0, 1))
    reader = _Reader(data, 1, len(data) - INDEX_TAIL)
    last = [0, 0]
    result = np.empty(count, np.uint32)
    for number in range(count):
        value = reader.read_varint()
        which, value = value & 1, value >> 1
        last[which] = (last[which] + ((value >> 1) ^ -(value & 1))) & 0xFFFFFFFF
        result[number] = last[which]
    return result


class _Reader:
    def __init__(self, data: bytes, position: int, end: int) -> None:
        self.data, self.position, self.end, self.last = data, position, end, 0

    def read_byte(self) -> int:
        if self.position >= self.end:
            raise InputError(_DAMAGED)
        self.position += 1
        return self.data[self.position - 1]

    def read_varint(self) -> int:
        value = shift = 0
        for _ in range(5):
            byte = self.read_byte()
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value
        raise InputError(_DAMAGED)

    def read_index(self) -> int:
        value = self.read_varint()
        self.last = (self.last + ((value >> 1) ^ -(value & 1))) & 0xFFFFFFFF
        return self.last


class _Triangles:
    """The state of decoding triangles: the newest edges and vertices, and the next vertex that no triangle has had."""

    def __init__(self, auxiliary: bytes, reader: _Reader) -> None:
        self.edges: list[tuple[int, int]] = [(0, 0)] * FIFO
        self.vertices = [0] * FIFO
        self.edge_count = self.vertex_count = self.next = 0
        self.auxiliary, self.reader = auxiliary, reader

    def push_vertex(self, vertex: int) -> None:
        self.vertices[self.vertex_count % FIFO] = vertex
        self.vertex_count += 1

    def push_edge(self, first: int, second: int) -> None:
        self.edges[self.edge_count % FIFO] = (first, second)
        self.edge_count += 1

    def add_vertex(self) -> int:
        self.next += 1
        return self.next - 1

    def read_on_edge(self, code: int, cached_codes: int) -> tuple[int, int, int]:
        """Return the triangle of a new vertex and an edge that another triangle had."""
        a, b = self.edges[(self.edge_count - 1 - (code >> 4)) % FIFO]
        which = code & 15
        if which == 0:
            c = self.add_vertex()
            self.push_vertex(c)
        elif which < cached_codes:
            c = self.vertices[(self.vertex_count - 1 - which) % FIFO]
        else:
            if which == 15:
                c = self.reader.read_index()
            else:
                c = self.reader.last = (self.reader.last + (which - (which ^ 3))) & 0xFFFFFFFF
            self.push_vertex(c)
        self.push_edge(c, b)
        self.push_edge(a, c)
        return a, b, c

    def read_apart(self, code: int) -> tuple[int, int, int]:
        """Return a triangle that shares no edge with the newest ones."""
        listed = code < 0xFE
        pair = self.auxiliary[code & 15] if listed else self.reader.read_byte()
        second, third = pair >> 4, pair & 15
        if not listed and pair == 0:
            self.next = 0
        explicit = code == 0xFF
        a = 0 if explicit else self.add_vertex()
        base = self.vertex_count
        b = self.add_vertex() if second == 0 else self.vertices[(base - second) % FIFO]
        c = self.add_vertex() if third == 0 else self.vertices[(base - third) % FIFO]
        if explicit:
            a = self.reader.read_index()
        if not listed and second == 15:
            b = self.reader.read_index()
        if not listed and third == 15:
            c = self.reader.read_index()
        self.push_vertex(a)
        if second == 0 or (not listed and second == 15):
            self.push_vertex(b)
        if third == 0 or (not listed and third == 15):
            self.push_vertex(c)
        for edge in ((b, a), (c, b), (a, c)):
            self.push_edge(*edge)
        return a, b, c


def decode_triangles(data: bytes, count: int) -> NDArray[np.uint32]:
    """Return the vertices of a stream of triangles [shape=(count,)]. Raises InputError: another version, or short."""
    _check_header(data, TRIANGLES, (0, 1))
    cached_codes = 13 if data[0] & 15 else 15
    end = len(data) - TRIANGLE_TAIL
    if count % 3 or 1 + count // 3 > end:
        raise InputError(_DAMAGED)
    state = _Triangles(data[end:], _Reader(data, 1 + count // 3, end))
    result = np.empty((count // 3, 3), np.uint32)
    for number, code in enumerate(data[1 : 1 + count // 3]):
        result[number] = state.read_on_edge(code, cached_codes) if code < 0xF0 else state.read_apart(code)
    return result.reshape(-1)


def _check_header(data: bytes, kind: int, versions: tuple[int, ...]) -> None:
    if not data or data[0] & 0xF0 != kind:
        raise InputError(_DAMAGED)
    if data[0] & 15 not in versions:
        raise InputError(
            f"version {data[0] & 15} of meshopt compression, required version {versions[-1]}; export it without "
            "compression"
        )
