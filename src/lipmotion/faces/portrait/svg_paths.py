"""Paths and transforms of SVG as arrays of points."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened

Points = NDArray[np.float64]
STEPS = 12
"""Points for each Bézier curve, and for a quarter of an ellipse."""
MOST_NUMBERS = 200_000
LARGEST = 1e6
"""Largest magnitude of a number in a drawing."""
_TOKEN = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
_COUNTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}


def path_lines(text: str) -> list[tuple[Points, bool]]:
    """Return the subpaths of a path's ``d``: points [shape=(N, 2)], and whether each returns to its beginning.

    Raises InputError: not a path.
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
            values = (
                np.array([values[0] + (relative and at[0]), at[1]])
                if kind == "H"
                else np.array([at[0], values[0] + (relative and at[1])])
            )
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
            points = _controls(kind, values.reshape(-1, 2), smooth)
            control = points[-2] if kind in "CSQT" else end
            current.extend(_bezier(np.vstack([at, *points])))
        if kind not in "CSQT":
            control = end
        at, before = end, kind
    finish(False)
    return lines


def _commands(text: str) -> list[tuple[str, list[float]]]:
    tokens = _TOKEN.findall(text)
    if len(tokens) > MOST_NUMBERS or re.sub(r"[\s,]", "", _TOKEN.sub("", text)):
        raise InputError(f"a path of {len(tokens)} parts cannot be read: {shortened(text)!r}")
    commands: list[tuple[str, list[float]]] = []
    letter, numbers = "", []
    for name, number in [*tokens, ("Z", "")]:
        if number:
            numbers.append(within(float(number), text))
            if letter and letter not in "Zz" and len(numbers) == _COUNTS[letter.upper()]:
                commands.append((letter, numbers))
                letter, numbers = {"M": "L", "m": "l"}.get(letter, letter), []
            elif not letter or letter in "Zz":
                raise InputError(f"a path has a number without a command: {shortened(text)!r}")
            continue
        if numbers:
            raise InputError(f"a path ends within a command: {shortened(text)!r}")
        letter = name
        if letter in "Zz":
            commands.append((letter, []))
    if commands and commands[0][0] not in "Mm" and len(commands) > 1:
        raise InputError(f"a path does not begin with M: {shortened(text)!r}")
    return commands[:-1]


def _controls(kind: str, points: Points, smooth: Points) -> list[Points]:
    if kind == "S":
        return [smooth, *points]
    if kind == "T":
        return [smooth, points[0]]
    return list(points)


def _bezier(points: Points) -> list[Points]:
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


def within(number: float, text: str) -> float:
    """Return the number. Raises InputError, with ``text``: it is larger than ``LARGEST``, or not finite."""
    if not abs(number) <= LARGEST:
        raise InputError(f"{number:g} in {shortened(text)!r}, required numbers up to {LARGEST:g}")
    return number


def points_of(text: str) -> Points:
    """Return the points of a polygon [shape=(N, 2)]. Raises InputError: an odd count, or no numbers."""
    try:
        numbers = [float(part) for part in re.split(r"[\s,]+", text.strip()) if part]
    except ValueError as error:
        raise InputError(f"points are {shortened(text)!r}, required numbers") from error
    for number in numbers:
        within(number, text)
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
    corners = [(x + width - radius, y + height - radius), (x + radius, y + height - radius), (x + radius, y + radius)]
    corners.append((x + width - radius, y + radius))
    quarter = np.linspace(0, np.pi / 2, STEPS + 1)
    parts = []
    for n, corner in enumerate(corners):
        angle = quarter + n * np.pi / 2
        parts.append(np.array(corner) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return np.vstack(parts)


def transform_of(text: str) -> Points:
    """Return the matrix of a ``transform`` [shape=(3, 3)]. Raises InputError: not a transform."""
    matrix = np.eye(3)
    for name, inside in re.findall(r"(\w+)\s*\(([^)]*)\)", text):
        try:
            numbers = [within(float(part), text) for part in re.split(r"[\s,]+", inside.strip()) if part]
            matrix = matrix @ _transform(name, numbers)
        except (ValueError, IndexError, KeyError) as error:
            raise InputError(f"the transform {shortened(f'{name}({inside})')!r} cannot be read") from error
    return matrix


def _transform(name: str, n: list[float]) -> Points:
    if name == "matrix":
        a, b, c, d, e, f = n
        return np.array([[a, c, e], [b, d, f], [0, 0, 1]])
    if name == "translate":
        return np.array([[1, 0, n[0]], [0, 1, n[1] if len(n) > 1 else 0], [0, 0, 1]])
    if name == "scale":
        return np.diag([n[0], n[1] if len(n) > 1 else n[0], 1.0])
    if name == "rotate":
        cos, sin = np.cos(np.radians(n[0])), np.sin(np.radians(n[0]))
        x, y = n[1:3] if len(n) > 2 else (0.0, 0.0)
        turned = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        return _transform("translate", [x, y]) @ turned @ _transform("translate", [-x, -y])
    skews = {"skewX": (0, 1), "skewY": (1, 0)}
    matrix = np.eye(3)
    matrix[skews[name]] = np.tan(np.radians(n[0]))
    return matrix
