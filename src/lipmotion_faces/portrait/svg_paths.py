"""Paths, points and transforms of SVG as arrays, each read in one pass."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten

Points = NDArray[np.float64]
STEPS = 12
"""Points for each Bézier curve, and for a quarter of an ellipse."""
MOST_POINTS = 400_000
"""Most points of all lines of a drawing; a curve has ``STEPS``, an arc four times as many."""
MOST_TRANSFORMS = 20
"""Most transforms one after another in one attribute."""
LARGEST_NUMBER = 1e6
"""Largest magnitude of a number in a drawing."""
_NUMBER = re.compile(r"[\s,]*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)")
_FLAG = re.compile(r"[\s,]*([01])")
_LETTER = re.compile(r"[\s,]*([MmLlHhVvCcSsQqTtAaZz])")
_BLANK = re.compile(r"[\s,]*")
_COUNTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_POINTS = {"C": STEPS, "S": STEPS, "Q": STEPS, "T": STEPS, "A": 4 * STEPS}


def flatten_path(text: str, most: int = MOST_POINTS) -> list[tuple[Points, bool]]:
    """Return a path's subpaths [shape=(N, 2)], and whether each is closed. Raises InputError: no path, or over ``most``
    points.
    """
    lines: list[tuple[Points, bool]] = []
    current: list[Points] = []
    at = start = control = np.zeros(2)
    before = ""

    def finish(closed: bool) -> None:
        if len(current) > 1:
            lines.append((np.array(current), closed))
        current.clear()

    for letter, numbers in _commands(text):
        kind, relative = letter.upper(), letter.islower()
        most -= _POINTS.get(kind, 1)
        check_points(most)
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
            current.extend(_arc(at, end, *numbers[:5]))
        else:
            smooth = 2 * at - control if before in ("CS" if kind == "S" else "QT") else at
            points = [at, *([smooth] if kind in "ST" else []), *values.reshape(-1, 2)]
            control = points[-2]
            current.extend(_bezier(points))
        if kind not in "CSQT":
            control = end
        at, before = end, kind
    finish(False)
    return lines


def check_points(left: int) -> None:
    """Raise InputError if so many more points are fewer than none."""
    if left < 0:
        raise InputError(f"more than {MOST_POINTS} points in all its lines; simplify the paths")


def _commands(text: str) -> Iterator[tuple[str, list[float]]]:
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


def _bezier(points: list[Points]) -> list[Points]:
    """Return points along a quadratic or cubic Bézier curve, without its first one."""
    t = np.linspace(0, 1, STEPS + 1)[1:, None]
    levels = [points[k][None] + 0 * t for k in range(len(points))]
    while len(levels) > 1:
        levels = [one + t * (other - one) for one, other in pairwise(levels)]
    return list(levels[0])


def _arc(at: Points, end: Points, rx: float, ry: float, turned: float, large: float, sweep: float) -> list[Points]:
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


def read_numbers(text: str, most: int, name: str) -> list[float]:
    """Return the numbers of a list. Raises InputError, with its name: not numbers, or more than ``most``."""
    numbers: list[float] = []
    place = 0
    while match := _NUMBER.match(text, place):
        if len(numbers) == most:
            raise InputError(f"{name} is {shorten(text)!r}, required at most {most} numbers")
        numbers.append(check_number(float(match[1]), text))
        place = match.end()
    if _end_of_blanks(text, place) < len(text):
        raise InputError(f"{name} is {shorten(text)!r}, required numbers")
    return numbers


def read_points(text: str, most: int = MOST_POINTS) -> Points:
    """Return the points of a polygon [shape=(N, 2)]. Raises InputError: an odd count, no numbers, or too many."""
    numbers = read_numbers(text, 2 * most, "points")
    if len(numbers) % 2 or len(numbers) < 4:
        raise InputError(f"points have {len(numbers)} numbers, required pairs, two at least")
    return np.array(numbers).reshape(-1, 2)


def circle(x: float, y: float, radius_x: float, radius_y: float) -> Points:
    """Return an ellipse [shape=(N, 2)]."""
    angle = np.linspace(0, 2 * np.pi, 4 * STEPS, endpoint=False)
    return np.stack([x + radius_x * np.cos(angle), y + radius_y * np.sin(angle)], axis=1)


def rectangle(x: float, y: float, width: float, height: float, radius: float) -> Points:
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
    *calls, rest = text.split(")", MOST_TRANSFORMS)
    if rest.strip():
        raise InputError(f"the transform {shorten(rest)!r} cannot be read, required at most {MOST_TRANSFORMS}")
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
