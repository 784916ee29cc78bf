"""Drawings as users make them: a safe subset of SVG, as shapes in named layers.

Read are groups, paths, rectangles, circles, ellipses, polygons, polylines and lines with plain colours, strokes,
opacity and transforms. What could reach outside the file (references, scripts, pictures, styles, entities) is refused,
and so is what would be drawn wrongly without notice, as gradients, dashes and text. What is hidden is passed over, but
not the mouths and eyes, of which one is shown at a time. The text is UTF-8, whatever it declares.
It is read in one pass, which ends at the first thing that is refused: ``LARGEST_FILE_BYTES`` and the other limits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.parsers import expat

import numpy as np

from lipmotion.errors import InputError, shorten
from lipmotion.storage.sources import check_regular
from lipmotion_faces.portrait.design import Colour, Points, make_ellipse

STEPS = 12  # points for each Bézier curve, and for a quarter of an ellipse
MAX_POINTS = 400_000  # most points of all lines of a drawing; a curve has ``STEPS``, an arc four times as many
MAX_TRANSFORMS = 20  # most transforms one after another in one attribute
LARGEST_NUMBER = 1e6  # largest magnitude of a number in a drawing
_NUMBER = re.compile(r"[\s,]*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)")
_FLAG = re.compile(r"[\s,]*([01])")
_LETTER = re.compile(r"[\s,]*([MmLlHhVvCcSsQqTtAaZz])")
_BLANK = re.compile(r"[\s,]*")
_COUNTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_POINTS = {"C": STEPS, "S": STEPS, "Q": STEPS, "T": STEPS, "A": 4 * STEPS}


Line = tuple[Points, bool]  # a flattened subpath: points [shape=(N, 2)], and whether it returns to its beginning


def flatten_path(text: str, max_count: int = MAX_POINTS) -> list[Line]:
    """Return subpaths [shape=(N, 2)], and whether each is closed. Raises InputError: no path, or too many points."""
    lines: list[Line] = []
    current: list[Points] = []
    at = start = control = np.zeros(2)
    before = ""

    def finish(closed: bool) -> None:
        if len(current) > 1:
            lines.append((np.array(current), closed))
        current.clear()

    for letter, numbers in _read_commands(text):
        kind, relative = letter.upper(), letter.islower()
        max_count -= _POINTS.get(kind, 1)
        check_points(max_count)
        if kind == "Z":
            finish(True)
            at = start
            before = kind
            continue
        if kind == "M":
            finish(False)
        if not current and kind != "M":
            current.append(at)
        values = np.array(numbers)
        if kind in "HV":
            axis = "HV".index(kind)
            values = np.where(np.arange(2) == axis, values[0] + at[axis] * relative, at)
        elif kind == "A":
            values[5:] += at * relative
        else:
            values = (values.reshape(-1, 2) + at * relative).ravel()
        end = values[-2:]
        if kind in "MLHV":
            current.append(end)
            start = end if kind == "M" else start
        elif kind == "A":
            current.extend(_trace_arc(at, end, *numbers[:5]))
        else:
            smooth = 2 * at - control if before in ("CS" if kind == "S" else "QT") else at
            points = [at, *([smooth] if kind in "ST" else []), *values.reshape(-1, 2)]
            control = points[-2]
            current.extend(_trace_bezier(points))
        if kind not in "CSQT":
            control = end
        at, before = end, kind
    finish(False)
    return lines


def check_points(left: int) -> None:
    """Raise InputError if so many more points are fewer than none."""
    if left < 0:
        raise InputError(f"more than {MAX_POINTS} points in all its lines; simplify the paths")


def _read_commands(text: str) -> Iterator[tuple[str, list[float]]]:
    """Yield the commands of a path with their numbers; a repeated one has its letter again."""
    letter, place = "", _end_of_blanks(text, 0)
    while place < len(text):
        match = _LETTER.match(text, place)
        if match:
            if not letter and match[1] not in "Mm":
                raise InputError(f"a path does not begin with M: {shorten(text)!r}")
            letter, place = match[1], match.end()
        elif not letter or letter in "Zz":
            what = "a number without a command" if _NUMBER.match(text, place) else "what cannot be read"
            raise InputError(f"a path has {what}: {shorten(text[place:])!r}")
        else:
            letter = {"M": "L", "m": "l"}.get(letter, letter)
        numbers = []
        for n in range(_COUNTS[letter.upper()]):
            pattern = _FLAG if letter in "Aa" and n in (3, 4) else _NUMBER
            match = pattern.match(text, place)
            if not match:
                rest = text[_end_of_blanks(text, place) :]
                wrong = f"cannot be read at {shorten(rest)!r}" if rest and not _LETTER.match(rest) else ""
                raise InputError(f"a path {wrong or f'ends within a command: {shorten(text)!r}'}")
            numbers.append(check_number(float(match[1]), text))
            place = match.end()
        yield letter, numbers
        place = _end_of_blanks(text, place)


def _end_of_blanks(text: str, place: int) -> int:
    match = _BLANK.match(text, place)
    return match.end() if match else place


def _trace_bezier(points: list[Points]) -> list[Points]:
    """Return points along a quadratic or cubic Bézier curve, without its first one."""
    t = np.linspace(0, 1, STEPS + 1)[1:, None]
    levels = [points[k][None] + 0 * t for k in range(len(points))]
    while len(levels) > 1:
        levels = [one + t * (other - one) for one, other in pairwise(levels)]
    return list(levels[0])


def _trace_arc(
    at: Points, end: Points, rx: float, ry: float, turned: float, large: float, sweep: float
) -> list[Points]:
    """Return points along an elliptic arc, without its first one (SVG 1.1, F.6.5)."""
    rx, ry = abs(rx), abs(ry)
    if rx < 1e-9 or ry < 1e-9 or np.allclose(at, end):
        return [end]
    cos, sin = np.cos(np.radians(turned)), np.sin(np.radians(turned))
    turn = np.array([[cos, sin], [-sin, cos]])
    x, y = turn @ (at - end) / 2
    grown = np.sqrt(max((x / rx) ** 2 + (y / ry) ** 2, 1.0))
    rx, ry = rx * grown, ry * grown
    rest = max((rx * ry) ** 2 - (rx * y) ** 2 - (ry * x) ** 2, 0.0) / ((rx * y) ** 2 + (ry * x) ** 2)
    sign = 1 if bool(large) != bool(sweep) else -1
    centre = sign * np.sqrt(rest) * np.array([rx * y / ry, -ry * x / rx])
    middle = turn.T @ centre + (at + end) / 2
    first = np.arctan2((y - centre[1]) / ry, (x - centre[0]) / rx)
    last = np.arctan2((-y - centre[1]) / ry, (-x - centre[0]) / rx)
    span = (last - first) % (2 * np.pi)
    span = span if sweep else span - 2 * np.pi
    angles = first + span * np.linspace(0, 1, 4 * STEPS + 1)[1:]
    return list(np.stack([rx * np.cos(angles), ry * np.sin(angles)], axis=1) @ turn + middle)


def check_number(number: float, text: str) -> float:
    """Return the number. Raises InputError, with ``text``: it is larger than ``LARGEST_NUMBER``, or not finite."""
    if not abs(number) <= LARGEST_NUMBER:
        raise InputError(f"{number:g} in {shorten(text)!r}, required numbers up to {LARGEST_NUMBER:g}")
    return number


def read_numbers(text: str, max_count: int, name: str) -> list[float]:
    """Return the numbers of a list. Raises InputError, with its name: not numbers, or more than ``max_count``."""
    numbers: list[float] = []
    place = 0
    while match := _NUMBER.match(text, place):
        if len(numbers) == max_count:
            raise InputError(f"{name} is {shorten(text)!r}, required at most {max_count} numbers")
        numbers.append(check_number(float(match[1]), text))
        place = match.end()
    if _end_of_blanks(text, place) < len(text):
        raise InputError(f"{name} is {shorten(text)!r}, required numbers")
    return numbers


def make_rectangle(x: float, y: float, width: float, height: float, radius: float) -> Points:
    """Return a rectangle with round corners [shape=(N, 2)]."""
    radius = min(max(radius, 0), width / 2, height / 2)
    if radius <= 0:
        return np.array([[x + width, y + height], [x, y + height], [x, y], [x + width, y]])
    corners = [(x + width - radius, y + height - radius), (x + radius, y + height - radius), (x + radius, y + radius)]
    corners.append((x + width - radius, y + radius))
    angles = [np.linspace(0, np.pi / 2, STEPS + 1) + n * np.pi / 2 for n in range(4)]
    rounds = [radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) for angle in angles]
    return np.vstack([np.array(corner) + each for corner, each in zip(corners, rounds, strict=True)])


def read_transform(text: str) -> Points:
    """Return the matrix of a ``transform`` [shape=(3, 3)]. Raises InputError: not a transform, or what enlarges more
    than ``LARGEST_NUMBER`` times."""
    matrix = np.eye(3)
    *calls, rest = text.split(")", MAX_TRANSFORMS)
    if rest.strip():
        raise InputError(f"the transform {shorten(rest)!r} cannot be read, required at most {MAX_TRANSFORMS}")
    for call in calls:
        name, _, inside = call.strip(", \t\r\n").partition("(")
        try:
            n = read_numbers(inside, 6, name)
            name, one = name.rstrip(), np.eye(3)
            if name == "matrix":
                one[0, 0], one[1, 0], one[0, 1], one[1, 1], one[0, 2], one[1, 2] = n
            elif name == "translate":
                one[:2, 2] = n[0], n[1] if len(n) > 1 else 0
            elif name == "scale":
                one = np.diag([n[0], n[1] if len(n) > 1 else n[0], 1.0])
            elif name == "rotate":
                cos, sin = np.cos(np.radians(n[0])), np.sin(np.radians(n[0]))
                x, y = n[1:3] if len(n) > 2 else (0.0, 0.0)
                one = np.array([[cos, -sin, x - cos * x + sin * y], [sin, cos, y - sin * x - cos * y], [0, 0, 1]])
            else:
                one[{"skewX": (0, 1), "skewY": (1, 0)}[name]] = np.tan(np.radians(n[0]))
        except (ValueError, IndexError, KeyError) as error:
            raise InputError(f"the transform {shorten(call + ')')!r} cannot be read") from error
        matrix = check_matrix(matrix @ one)
    return matrix


def check_matrix(matrix: Points) -> Points:
    """Return a matrix of transforms. Raises InputError: it enlarges or moves beyond ``LARGEST_NUMBER``."""
    if not np.abs(matrix).max() <= LARGEST_NUMBER:
        raise InputError(f"transforms in one another enlarge beyond {LARGEST_NUMBER:g} times")
    return matrix


LARGEST_SIDE_RATIO = 4.0
LARGEST_FILE_BYTES, MAX_ELEMENTS, DEEPEST_NESTING = 8 << 20, 20_000, 60
"""Most bytes of a drawing, elements in it, and elements in one another."""
MAX_COVERED_PICTURES, LINES_PER_PICTURE = 200.0, 100.0
"""Most that shapes cover, in pictures; lines across the picture that take as long to paint as one picture."""
LONGEST_VALUE_CHARACTERS = 100  # most letters of a number, a colour or another value of a style
_SHAPES = {"path", "rect", "circle", "ellipse", "polygon", "polyline", "line"}
_PASSED_OVER = {"title", "desc", "metadata", "namedview", "defs", "guide", "grid", "page", "RDF"}
_INHERITED = ("fill", "fill-opacity", "fill-rule", "stroke", "stroke-width", "stroke-opacity", "visibility")
_UNREAD = ("stroke-dasharray", "mix-blend-mode", "vector-effect", "transform-origin", "transform")
_UNITS = {"px": 1.0, "pt": 4 / 3, "pc": 16.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0}
MOUTH, EYES = "mouth-", ("eyes-open", "eyes-closed")
LAYERS = ("head", *EYES, "pupils", "brows", "background")
"""The layers beside those of the mouths, whose names begin with ``MOUTH``."""


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
    return _DrawingReader().read(text)


class _Group(NamedTuple):
    """What an element hands down: groups' names, the matrix to the drawing's units [shape=(3, 3)], inherited style."""

    layers: tuple[str, ...]
    matrix: Points
    style: Mapping[str, str]
    opacity: float


@dataclass
class _DrawingReader:
    """Takes the elements of one drawing as the parser finds them."""

    box: tuple[float, float, float, float] | None = None
    shapes: list[tuple[tuple[str, ...], Shape]] = field(default_factory=list)
    groups: list[_Group] = field(default_factory=list)
    depth: int = 0  # of elements that are open
    passed: int = 0  # depth of the element that is passed over with all in it; 0: none
    elements: int = 0
    points: int = 0
    covered: float = 0.0

    def read(self, text: str) -> Drawing:
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
        if self.elements > MAX_ELEMENTS:
            raise InputError(f"more than {MAX_ELEMENTS} elements")
        if self.depth > DEEPEST_NESTING:
            raise InputError(f"groups in groups, more than {DEEPEST_NESTING} deep")
        tag = name.rpartition(":")[2]
        if tag == "style":
            _refuse_style_sheet("xml-stylesheet")
        if self.passed:
            return
        if self.box is None:
            if tag != "svg":
                raise InputError(f"not an SVG: its root is {shorten(tag)!r}")
            self.box = _read_box(attributes)
            self.groups.append(_group(attributes, _Group((), np.eye(3), {}, 1.0)))
        elif tag in _PASSED_OVER or _read_style(attributes).get("display") == "none":
            self.passed = self.depth
        elif len(self.groups) < self.depth - 1:
            raise InputError(f"<{shorten(tag)}> in a shape is not read; remove it")
        elif tag == "g":
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
        lines = _read_lines(attributes, tag, MAX_POINTS - self.points)
        self.points += sum(len(points) for points, _ in lines)
        check_points(MAX_POINTS - self.points)
        style, matrix = group.style, group.matrix
        fill, filled = _read_colour(style.get("fill", "black"), "fill")
        stroke, stroked = _read_colour(style.get("stroke", "none"), "stroke")
        shown = group.opacity * (style.get("visibility", "visible") == "visible")
        filled, stroked = (
            float(np.clip(shown * alpha * _read_number(style.get(f"{kind}-opacity", "1"), "opacity"), 0, 1))
            for kind, alpha in (("fill", filled), ("stroke", stroked))
        )
        placed = tuple((points @ matrix[:2, :2].T + matrix[:2, 2], closed) for points, closed in lines)
        if not all(np.abs(points).max(initial=0) <= 1e3 * LARGEST_NUMBER for points, _ in placed):
            raise InputError(f"a shape is {1e3 * LARGEST_NUMBER:g} units away; check the transforms")
        scale = float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))
        shape = Shape(
            placed,
            None if tag == "line" else fill,
            stroke,
            scale * _read_number(style.get("stroke-width", "1"), "stroke-width"),
            (filled, stroked),
            style.get("fill-rule") == "evenodd",
        )
        self.covered += _measure_cover(shape, self.box or (0, 0, 1, 1))
        if self.covered > MAX_COVERED_PICTURES:
            raise InputError(f"its shapes cover more than {MAX_COVERED_PICTURES:g} times the picture; leave some out")
        self.shapes.append((group.layers, shape))


def _refuse_subset(_name: str, _system: str | None, _public: str | None, has_subset: int) -> None:
    """Refuse a document type with declarations; one that is only named changes nothing."""
    if has_subset:
        _refuse_entity()


def _refuse_entity(*_: object) -> NoReturn:
    raise InputError("it declares or uses entities; save it as plain SVG")


def _refuse_style_sheet(target: str, _: str = "") -> None:
    if target == "xml-stylesheet":
        raise InputError("a style sheet is not read; export presentation attributes instead")


def _read_box(root: Mapping[str, str]) -> tuple[float, float, float, float]:
    text = root.get("viewBox", "")
    numbers = read_numbers(text, 4, "viewBox")
    if not numbers:
        numbers = [0, 0, *(_read_number(root.get(name, "0"), name) for name in ("width", "height"))]
    if len(numbers) != 4 or not (1e-3 <= numbers[2] < 1e6 and 1e-3 <= numbers[3] < 1e6):
        raise InputError(f"the view box is {shorten(text)!r}, required four numbers, the last two 0.001 or more")
    if not 1 / LARGEST_SIDE_RATIO <= numbers[2] / numbers[3] <= LARGEST_SIDE_RATIO:
        raise InputError(
            f"the picture is {numbers[2]:g} by {numbers[3]:g}, required at most {LARGEST_SIDE_RATIO:g} times as "
            "long as wide"
        )
    return numbers[0], numbers[1], numbers[2], numbers[3]


def _read_number(text: str, name: str) -> float:
    unit = text.strip()[-2:]
    numbers = read_numbers(text.strip().removesuffix(unit) if unit in _UNITS else text, 1, name)
    if not numbers:
        raise InputError(f"{name} is {shorten(text)!r}, required a number")
    return numbers[0] * _UNITS.get(unit, 1.0)


def _name_layer(attributes: Mapping[str, str]) -> str:
    """Return the name of an element: of its label, ``data-name`` and id the first that names a layer, else the first.

    Illustrator writes ``mouth_x2D_aa``, and ``mouth-aa_1_`` or ``mouth-aa-2`` for another one of the same name.
    """
    texts = [
        re.sub(r"[\s_-]\d+_?$", "", value.strip())
        for ending in (":label", "data-name", ":id", "id")
        for key, value in attributes.items()
        if key.endswith(ending) and value.strip()
    ]
    names = [re.sub(r"(_x[0-9A-F]{2}_|[\s_-])+", "-", text).casefold() for text in texts]
    return next((name for name in names if name in LAYERS or name.startswith(MOUTH)), names[0] if names else "")


def _read_style(attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the style of an element itself, shown if it is a mouth or eyes. Raises InputError: not read."""
    style = {name: value for name, value in attributes.items() if name != "transform"}
    for part in attributes.get("style", "").split(";"):
        name, _, value = part.partition(":")
        style[name.strip()] = value.strip()
    for name in _UNREAD:
        if style.get(name, "none") not in ("none", "normal", "0", ""):
            raise InputError(f"{name}={shorten(style[name])!r} is not read; convert it to paths with plain colours")
    layer = _name_layer(attributes)
    if layer in EYES or layer.startswith(MOUTH):
        style |= {"display": "inline", "visibility": "visible"}
    return style


def _group(attributes: Mapping[str, str], around: _Group) -> _Group:
    """Return what an element hands down, or for a shape what it has itself."""
    for key, value in attributes.items():
        name = key.rpartition(":")[2]
        if name == "href" or "url(" in value:
            raise InputError(f"{shorten(name)}={shorten(value)!r} is a reference; required plain colours and shapes")
        if name.lower().startswith("on"):
            raise InputError(f"a script, {shorten(name)!r}, is not allowed")
    style = {name: value for name, value in _read_style(attributes).items() if name in (*_INHERITED, "opacity")}
    for name, value in style.items():
        if len(value) > LONGEST_VALUE_CHARACTERS:
            raise InputError(f"{name} is {shorten(value)!r}, required a number or a plain colour")
    opacity = around.opacity * float(np.clip(_read_number(style.pop("opacity", "1"), "opacity"), 0, 1))
    matrix = around.matrix
    if "transform" in attributes:
        matrix = check_matrix(matrix @ read_transform(attributes["transform"]))
    layers = tuple(name for name in (*around.layers, _name_layer(attributes)) if name)
    return _Group(layers, matrix, {**around.style, **style}, opacity)


def _measure_cover(shape: Shape, box: tuple[float, float, float, float]) -> float:
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


def _read_lines(attributes: Mapping[str, str], tag: str, max_count: int) -> list[Line]:
    def read(name: str, default: str = "0") -> float:
        return _read_number(attributes.get(name, default), name)

    if tag == "path":
        return flatten_path(attributes.get("d", ""), max_count)
    if tag in ("polygon", "polyline"):
        numbers = read_numbers(attributes.get("points", ""), 2 * max_count, "points")
        if len(numbers) % 2 or len(numbers) < 4:
            raise InputError(f"points have {len(numbers)} numbers, required pairs, two at least")
        return [(np.array(numbers).reshape(-1, 2), tag == "polygon")]
    if tag == "line":
        return [(np.array([[read("x1"), read("y1")], [read("x2"), read("y2")]]), False)]
    if tag == "rect":
        radius = read("rx", attributes.get("ry", "0"))
        return [(make_rectangle(read("x"), read("y"), read("width"), read("height"), radius), True)]
    radii = (read("r"),) * 2 if tag == "circle" else (read("rx"), read("ry"))
    return [(make_ellipse(read("cx"), read("cy"), *radii, 4 * STEPS), True)]


def _read_colour(text: str, name: str) -> tuple[Colour | None, float]:
    """Return a colour and its opacity, 0..1."""
    from PIL import ImageColor

    if text.strip() in ("none", "transparent"):
        return None, 0.0
    try:
        inside = re.fullmatch(r"rgba\((.*),(.*)\)", text.strip())
        found = ImageColor.getrgb(f"rgb({inside[1]})" if inside else text.strip())
        red, green, blue, alpha = (min(max(part, 0), 255) for part in (*found, 255)[:4])
        return (red, green, blue), float(inside[2]) if inside else alpha / 255
    except ValueError as error:
        raise InputError(f"{name} is {shorten(text)!r}, required a plain colour as #40a0ff") from error
