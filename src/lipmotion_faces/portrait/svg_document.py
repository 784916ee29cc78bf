"""Drawings as users make them: a safe subset of SVG, as shapes in named layers.

Read are groups, paths, rectangles, circles, ellipses, polygons, polylines and lines with plain colours, strokes,
opacity and transforms. What could reach outside the file (references, scripts, pictures, styles, entities) is refused,
and so is what would be drawn wrongly without notice, as gradients and text. The text is UTF-8, whatever it declares.
It is read in one pass, which ends at the first thing that is refused: ``LARGEST_FILE_BYTES`` and the other limits.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.storage.files import check_regular
from lipmotion_faces.portrait.svg_paths import (
    LARGEST_NUMBER,
    MOST_POINTS,
    check_matrix,
    check_points,
    circle,
    flatten_path,
    read_numbers,
    read_points,
    read_transform,
    rectangle,
)

Points = NDArray[np.float64]
LARGEST_SIDE_RATIO = 4.0
"""Largest ratio of the sides of a picture."""
LARGEST_FILE_BYTES, MOST_ELEMENTS, DEEPEST_NESTING = 8 << 20, 20_000, 60
"""Most bytes of a drawing, elements in it, and elements in one another."""
MOST_COVERED_PICTURES, LINES_PER_PICTURE = 200.0, 100.0
"""Most that shapes cover, in pictures; lines across the picture that take as long to paint as one picture."""
LONGEST_VALUE_CHARACTERS = 100
"""Most letters of a number, a colour or another value of a style."""
_SHAPES = {"path", "rect", "circle", "ellipse", "polygon", "polyline", "line"}
_PASSED_OVER = {"title", "desc", "metadata", "namedview", "defs", "guide", "grid", "page", "RDF"}
_INHERITED = ("fill", "fill-opacity", "fill-rule", "stroke", "stroke-width", "stroke-opacity")
_UNIT = re.compile(r"(.*?)(?:px|pt|mm|cm|in)", re.DOTALL)
Colour = tuple[int, int, int]


class Line(NamedTuple):
    """A flattened subpath: points [shape=(N, 2)], and whether it returns to its beginning."""

    points: Points
    closed: bool


@dataclass(frozen=True, eq=False)
class Shape:
    """One shape in the units of the drawing.

    lines        : its subpaths
    fill, stroke : colours; None: none
    opacities    : of fill and stroke, 0..1
    even_odd     : the rule by which subpaths make holes; else non-zero winding
    """

    lines: tuple[Line, ...]
    fill: Colour | None
    stroke: Colour | None
    width: float
    opacities: tuple[float, float]
    even_odd: bool


@dataclass(frozen=True, eq=False)
class Drawing:
    """A drawing: its view box (x, y, width, height), and shapes from back to front with the names of their layers."""

    box: tuple[float, float, float, float]
    shapes: tuple[tuple[tuple[str, ...], Shape], ...]


def read_drawing(path: Path) -> Drawing:
    """Return the drawing in an ``.svg`` file.

    Raises InputError: no such file, no SVG, something that is not read, a reference to outside of the file, or more
    than a drawing may hold.
    """
    try:
        check_regular(path, "drawing")
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    try:
        return parse_drawing(data)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def parse_drawing(data: bytes) -> Drawing:
    """Return the drawing in the bytes of an ``.svg`` file. Raises InputError: as ``read_drawing``."""
    if len(data) > LARGEST_FILE_BYTES:
        raise InputError(f"more than {LARGEST_FILE_BYTES} bytes; is it a drawing?")
    if data[:2] == b"\x1f\x8b":
        raise InputError("it is compressed (.svgz); save it as plain SVG")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"not text in UTF-8 (byte {error.start}); save it as plain SVG in UTF-8") from error
    return _DrawingReader().drawing(text)


class _Group(NamedTuple):
    """What an element hands down: groups' names, the matrix to the drawing's units [shape=(3, 3)], inherited style."""

    layers: tuple[str, ...]
    matrix: Points
    style: Mapping[str, str]
    opacity: float


@dataclass
class _DrawingReader:
    """Takes the elements of one drawing as the parser finds them.

    depth   : of elements that are open
    passed  : depth of the element that is passed over with all in it; 0: none
    """

    box: tuple[float, float, float, float] | None = None
    shapes: list[tuple[tuple[str, ...], Shape]] = field(default_factory=list)
    groups: list[_Group] = field(default_factory=list)
    depth: int = 0
    passed: int = 0
    elements: int = 0
    points: int = 0
    covered: float = 0.0

    def drawing(self, text: str) -> Drawing:
        parser = expat.ParserCreate("utf-8")  # overrides what the text declares
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
        parser.StartDoctypeDeclHandler, parser.SkippedEntityHandler = _refuse_subset, _refuse_entity
        parser.ProcessingInstructionHandler = _refuse_style_sheet
        try:
            parser.Parse(text, True)
        except expat.ExpatError as error:
            raise InputError(f"not an SVG: {error}") from error
        if not self.shapes or self.box is None:
            raise InputError("there is no shape in it")
        return Drawing(self.box, tuple(self.shapes))

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self.elements, self.depth = self.elements + 1, self.depth + 1
        if self.elements > MOST_ELEMENTS:
            raise InputError(f"more than {MOST_ELEMENTS} elements")
        if self.depth > DEEPEST_NESTING:
            raise InputError(f"groups in groups, more than {DEEPEST_NESTING} deep")
        if self.passed:
            return
        tag = _local(name)
        if self.box is None:
            if tag != "svg":
                raise InputError(f"not an SVG: its root is {shorten(tag)!r}")
            self.box = _box(attributes)
            self.groups.append(_group(attributes, _Group((), np.eye(3), {}, 1.0)))
        elif tag in _PASSED_OVER:
            self.passed = self.depth
        elif len(self.groups) < self.depth - 1:
            raise InputError(f"<{shorten(tag)}> in a shape is not read; remove it")
        elif tag in ("g", "svg"):
            self.groups.append(_group(attributes, self.groups[-1]))
        elif tag in _SHAPES:
            self._add(tag, attributes)
        else:
            raise InputError(f"<{shorten(tag)}> is not read; convert it to paths with plain colours")

    def _end(self, _: str) -> None:
        if self.passed == self.depth:
            self.passed = 0
        elif not self.passed and len(self.groups) == self.depth:
            self.groups.pop()
        self.depth -= 1

    def _add(self, tag: str, attributes: Mapping[str, str]) -> None:
        group = _group(attributes, self.groups[-1])
        lines = _lines(attributes, tag, MOST_POINTS - self.points)
        self.points += sum(len(points) for points, _ in lines)
        check_points(MOST_POINTS - self.points)
        style, matrix = group.style, group.matrix
        opacities = [_number(style.get(f"{kind}-opacity", "1"), "opacity") for kind in ("fill", "stroke")]
        placed = tuple(Line(points @ matrix[:2, :2].T + matrix[:2, 2], closed) for points, closed in lines)
        if not all(np.abs(line.points).max(initial=0) <= 1e3 * LARGEST_NUMBER for line in placed):
            raise InputError(f"a shape is {1e3 * LARGEST_NUMBER:g} units away; check the transforms")
        fill = _colour(style.get("fill", "black"), "fill")
        scale = float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))
        shape = Shape(
            placed,
            None if tag == "line" else fill,
            _colour(style.get("stroke", "none"), "stroke"),
            scale * _number(style.get("stroke-width", "1"), "stroke-width"),
            (float(np.clip(group.opacity * opacities[0], 0, 1)), float(np.clip(group.opacity * opacities[1], 0, 1))),
            style.get("fill-rule") == "evenodd",
        )
        self.covered += _covered(shape, self.box or (0, 0, 1, 1))
        if self.covered > MOST_COVERED_PICTURES:
            raise InputError(f"its shapes cover more than {MOST_COVERED_PICTURES:g} times the picture; leave some out")
        self.shapes.append((self.groups[-1].layers, shape))


def _refuse_subset(_name: str, _system: str | None, _public: str | None, has_subset: int) -> None:
    """Refuse a document type with declarations; one that is only named changes nothing."""
    if has_subset:
        _refuse_entity()


def _refuse_entity(*_: object) -> NoReturn:
    raise InputError("it declares or uses entities; save it as plain SVG")


def _refuse_style_sheet(target: str, _: str) -> None:
    if target == "xml-stylesheet":
        raise InputError("a style sheet is not read; convert it to plain colours")


def _local(name: str) -> str:
    return name.rpartition(":")[2]


def _box(root: Mapping[str, str]) -> tuple[float, float, float, float]:
    text = root.get("viewBox", "")
    numbers = read_numbers(text, 4, "viewBox")
    if not numbers:
        numbers = [0, 0, *(_number(root.get(name, "0"), name) for name in ("width", "height"))]
    if len(numbers) != 4 or not (1e-3 <= numbers[2] < 1e6 and 1e-3 <= numbers[3] < 1e6):
        raise InputError(f"the view box is {shorten(text)!r}, required four numbers, the last two 0.001 or more")
    if not 1 / LARGEST_SIDE_RATIO <= numbers[2] / numbers[3] <= LARGEST_SIDE_RATIO:
        raise InputError(
            f"the picture is {numbers[2]:g} by {numbers[3]:g}, required at most {LARGEST_SIDE_RATIO:g} times as "
            "long as wide"
        )
    return numbers[0], numbers[1], numbers[2], numbers[3]


def _number(text: str, name: str) -> float:
    match = _UNIT.fullmatch(text.strip())
    numbers = read_numbers(match[1] if match else text, 1, name)
    if not numbers:
        raise InputError(f"{name} is {shorten(text)!r}, required a number")
    return numbers[0]


def _group(attributes: Mapping[str, str], around: _Group) -> _Group:
    """Return what an element hands down, or for a shape what it has itself."""
    for key, value in attributes.items():
        name = _local(key)
        if name == "href" or "url(" in value:
            raise InputError(f"{shorten(name)}={shorten(value)!r} is a reference; required plain colours and shapes")
        if name.lower().startswith("on"):
            raise InputError(f"a script, {shorten(name)!r}, is not allowed")
    names = (*_INHERITED, "opacity")
    style = {name: attributes[name] for name in names if name in attributes}
    for part in attributes.get("style", "").split(";"):
        name, _, value = part.partition(":")
        if name.strip() in names:
            style[name.strip()] = value.strip()
    for name, value in style.items():
        if len(value) > LONGEST_VALUE_CHARACTERS:
            raise InputError(f"{name} is {shorten(value)!r}, required a number or a plain colour")
    opacity = around.opacity * float(np.clip(_number(style.pop("opacity", "1"), "opacity"), 0, 1))
    matrix = around.matrix
    if "transform" in attributes:
        matrix = check_matrix(matrix @ read_transform(attributes["transform"]))
    name = next((value for key, value in attributes.items() if key.endswith(":label") and value), "")
    layers = (*around.layers, name or attributes.get("id", ""))
    return _Group(layers, matrix, {**around.style, **style}, opacity)


def _covered(shape: Shape, box: tuple[float, float, float, float]) -> float:
    """Return what a shape takes to paint, in pictures as large as the view box that are filled once."""
    first, size = np.array(box[:2]), np.array(box[2:])
    stroked = shape.stroke is not None and shape.width > 0
    covered = 0.0
    for points, _ in shape.lines:
        inside = np.clip((points - first) / size, 0, 1)
        steps = np.abs(np.diff(inside, axis=0, append=inside[:1]))
        covered += float(np.prod(np.ptp(inside, axis=0))) + float(steps[:, 1].sum()) / LINES_PER_PICTURE
        if stroked:
            width = min(shape.width / float(size.min()), 1.0)
            covered += float(np.minimum(width * (width + steps.sum(axis=1)), 1.0).sum())
    return covered


def _lines(attributes: Mapping[str, str], tag: str, most: int) -> list[tuple[Points, bool]]:
    def number(name: str, default: str = "0") -> float:
        return _number(attributes.get(name, default), name)

    if tag == "path":
        return flatten_path(attributes.get("d", ""), most)
    if tag in ("polygon", "polyline"):
        return [(read_points(attributes.get("points", ""), most), tag == "polygon")]
    if tag == "line":
        return [(np.array([[number("x1"), number("y1")], [number("x2"), number("y2")]]), False)]
    if tag == "rect":
        radius = number("rx", attributes.get("ry", "0"))
        return [(rectangle(number("x"), number("y"), number("width"), number("height"), radius), True)]
    radii = (number("r"),) * 2 if tag == "circle" else (number("rx"), number("ry"))
    return [(circle(number("cx"), number("cy"), *radii), True)]


def _colour(text: str, name: str) -> Colour | None:
    from PIL import ImageColor

    if text.strip() in ("none", "transparent"):
        return None
    try:
        red, green, blue, *_ = (min(max(part, 0), 255) for part in ImageColor.getrgb(text.strip()))
    except ValueError as error:
        raise InputError(f"{name} is {shorten(text)!r}, required a plain colour as #40a0ff") from error
    return red, green, blue
