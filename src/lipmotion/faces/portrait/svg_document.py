"""Drawings as users make them: a safe subset of SVG, as shapes in named layers.

Read are groups, paths, rectangles, circles, ellipses, polygons, polylines and lines with plain colours, strokes,
opacity and transforms. What could reach outside the file (references, scripts, pictures, styles, entities) is refused,
and so is what would be drawn wrongly without notice, as gradients and text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.faces.portrait.svg_paths import LARGEST, circle, path_lines, points_of, rectangle, transform_of

Points = NDArray[np.float64]
WIDEST = 4.0
"""Largest ratio of the sides of a picture."""
LARGEST_FILE, MOST_SHAPES, DEEPEST = 8 << 20, 20_000, 60
"""Most bytes of a drawing, shapes in it, and groups in one another."""
_SHAPES = {"path", "rect", "circle", "ellipse", "polygon", "polyline", "line"}
_PASSED_OVER = {"title", "desc", "metadata", "namedview", "defs", "guide", "grid", "page", "RDF"}
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
_INHERITED = ("fill", "fill-opacity", "fill-rule", "stroke", "stroke-width", "stroke-opacity")
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

    Raises InputError: no such file, no SVG, something that is not read, or a reference to outside of the file.
    """
    try:
        data = path.read_bytes() if path.stat().st_size <= LARGEST_FILE else None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    if data is None:
        raise InputError(f"{path}: more than {LARGEST_FILE} bytes; is it a drawing?")
    try:
        return drawing_of(data)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def drawing_of(data: bytes) -> Drawing:
    """Return the drawing in the bytes of an ``.svg`` file. Raises InputError: as ``read_drawing``."""
    if re.search(rb"<!\s*(DOCTYPE[^>]*\[|ENTITY)", data, re.IGNORECASE):
        raise InputError("it declares entities; save it as plain SVG")
    try:
        root = ElementTree.fromstring(data)  # noqa: S314 (entities are refused above)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"not an SVG: {error}") from error
    if _local(root.tag) != "svg":
        raise InputError(f"not an SVG: its root is {shortened(_local(root.tag))!r}")
    found: list[tuple[tuple[str, ...], Shape]] = []
    for layers, shape in _shapes(root, (), np.eye(3), {}, 1.0):
        found.append((layers, shape))
        if len(found) > MOST_SHAPES:
            raise InputError(f"more than {MOST_SHAPES} shapes")
    if not found:
        raise InputError("there is no shape in it")
    return Drawing(_box(root), tuple(found))


def _local(tag: object) -> str:
    return str(tag).rpartition("}")[2]


def _box(root: ElementTree.Element) -> tuple[float, float, float, float]:
    text = root.get("viewBox")
    numbers = [_number(part, "viewBox") for part in re.split(r"[\s,]+", text.strip())] if text else []
    if not numbers:
        numbers = [0, 0, *(_number(root.get(name, "0"), name) for name in ("width", "height"))]
    if len(numbers) != 4 or not (0 < numbers[2] < 1e6 and 0 < numbers[3] < 1e6):
        raise InputError(f"the view box is {shortened(str(text))!r}, required four numbers, the last two positive")
    if not 1 / WIDEST <= numbers[2] / numbers[3] <= WIDEST:
        raise InputError(
            f"the picture is {numbers[2]:g} by {numbers[3]:g}, required at most {WIDEST:g} times as long as wide"
        )
    return numbers[0], numbers[1], numbers[2], numbers[3]


def _number(text: str, name: str) -> float:
    try:
        number = float(re.sub(r"(px|pt|mm|cm|in)$", "", text.strip()))
    except ValueError:
        number = float("nan")
    if not abs(number) < 1e6:
        raise InputError(f"{name} is {shortened(text)!r}, required a number")
    return number


def _shapes(
    element: ElementTree.Element, layers: tuple[str, ...], matrix: Points, inherited: Mapping[str, str], opacity: float
) -> Iterator[tuple[tuple[str, ...], Shape]]:
    if len(layers) > DEEPEST:
        raise InputError(f"groups in groups, more than {DEEPEST} deep")
    _check_references(element)
    style = dict(inherited) | _style(element)
    opacity = opacity * float(np.clip(_number(style.pop("opacity", "1"), "opacity"), 0, 1))
    matrix = _bounded(matrix @ transform_of(element.get("transform", "")))
    name = element.get(_LABEL) or element.get("id") or ""
    for child in element:
        tag = _local(child.tag)
        if tag in ("g", "svg"):
            yield from _shapes(child, (*layers, name), matrix, _kept(style), opacity)
        elif tag in _SHAPES:
            yield (*layers, name), _shape(child, tag, matrix, _kept(style), opacity)
        elif tag not in _PASSED_OVER and isinstance(child.tag, str):
            raise InputError(f"<{shortened(tag)}> is not read; convert it to paths with plain colours")


def _bounded(matrix: Points) -> Points:
    if not np.abs(matrix).max() <= LARGEST:
        raise InputError(f"transforms in one another enlarge beyond {LARGEST:g} times")
    return matrix


def _kept(style: Mapping[str, str]) -> dict[str, str]:
    return {name: style[name] for name in _INHERITED if name in style}


def _check_references(element: ElementTree.Element) -> None:
    for name, value in element.attrib.items():
        if _local(name) == "href" or "url(" in value:
            raise InputError(f"{_local(name)}={shortened(value)!r} is a reference; required plain colours and shapes")
        if _local(name).lower().startswith("on"):
            raise InputError(f"a script, {_local(name)!r}, is not allowed")


def _style(element: ElementTree.Element) -> dict[str, str]:
    names = (*_INHERITED, "opacity")
    style = {name: element.attrib[name] for name in names if name in element.attrib}
    for part in element.get("style", "").split(";"):
        name, _, value = part.partition(":")
        if name.strip() in names:
            style[name.strip()] = value.strip()
    return style


def _shape(
    element: ElementTree.Element, tag: str, matrix: Points, inherited: Mapping[str, str], opacity: float
) -> Shape:
    _check_references(element)
    style = dict(inherited) | _style(element)
    matrix = _bounded(matrix @ transform_of(element.get("transform", "")))
    share = opacity * _number(style.get("opacity", "1"), "opacity")
    alphas = tuple(share * _number(style.get(f"{kind}-opacity", "1"), f"{kind}-opacity") for kind in ("fill", "stroke"))
    lines = tuple(Line(points @ matrix[:2, :2].T + matrix[:2, 2], closed) for points, closed in _lines(element, tag))
    if not all(np.abs(line.points).max(initial=0) <= 1e3 * LARGEST for line in lines):
        raise InputError(f"a shape is {1e3 * LARGEST:g} units away; check the transforms")
    scale = float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))
    shape = Shape(
        lines,
        _colour(style.get("fill", "black"), "fill"),
        _colour(style.get("stroke", "none"), "stroke"),
        scale * _number(style.get("stroke-width", "1"), "stroke-width"),
        (float(np.clip(alphas[0], 0, 1)), float(np.clip(alphas[1], 0, 1))),
        style.get("fill-rule") == "evenodd",
    )
    return replace(shape, fill=None) if tag == "line" else shape


def _lines(element: ElementTree.Element, tag: str) -> list[tuple[Points, bool]]:
    def number(name: str, default: str = "0") -> float:
        return _number(element.get(name, default), name)

    if tag == "path":
        return path_lines(element.get("d", ""))
    if tag in ("polygon", "polyline"):
        return [(points_of(element.get("points", "")), tag == "polygon")]
    if tag == "line":
        return [(np.array([[number("x1"), number("y1")], [number("x2"), number("y2")]]), False)]
    if tag == "rect":
        radius = number("rx", element.get("ry", "0"))
        return [(rectangle(number("x"), number("y"), number("width"), number("height"), radius), True)]
    radii = (number("r"),) * 2 if tag == "circle" else (number("rx"), number("ry"))
    return [(circle(number("cx"), number("cy"), *radii), True)]


def _colour(text: str, name: str) -> Colour | None:
    from PIL import ImageColor

    if text.strip() in ("none", "transparent"):
        return None
    try:
        colour = ImageColor.getrgb(text.strip())
    except ValueError as error:
        raise InputError(f"{name} is {shortened(text)!r}, required a plain colour as #40a0ff") from error
    return colour[0], colour[1], colour[2]
