"""Pages of HTML that need no network: elements that escape what they hold, and charts (SVG), light and dark."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from lipmotion.pipeline.batch.report import insert_colours
from lipmotion.printable import printable

VOID = frozenset({"br", "img", "link", "meta"})  # elements that hold nothing and have no end
SIMPLE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9-]*")
GENERATOR = '<meta name="generator" content="lipmotion">'  # what pages of this program hold


class Html(str):
    """Text that is HTML already. Every other text is escaped where it becomes part of an element."""

    __slots__ = ()


def element(name: str, *content: str, **attributes: str | bool | None) -> Html:
    """Return an element.

    content    : ``Html`` as it is; other texts are escaped, and what is invisible in them is shown (``printable``)
    attributes : ``class_`` is ``class``, ``aria_label`` is ``aria-label``; True: the name alone; False, None: left out
    Raises ValueError: no name of an element or an attribute.
    """
    words = [_simple(name)]
    for key, value in attributes.items():
        if value is not None and value is not False:
            attribute = _simple(key.rstrip("_").replace("_", "-"))
            words.append(attribute if value is True else f'{attribute}="{escape(printable(value))}"')
    start = f"<{' '.join(words)}>"
    return Html(start if name in VOID else f"{start}{joined(*content)}</{name}>")


def joined(*content: str) -> Html:
    """Return some content one after another, escaped as in ``element``."""
    return Html("".join(text if isinstance(text, Html) else escape(printable(text)) for text in content))


def build_page(title: str, style: str, *content: str) -> str:
    """Return a page that loads nothing but the pictures and videos in its own folder.

    style  : CSS, with ``SHARED_COLOURS`` in the place of the colours of all pages, without the end of its element: the
             caller's own, nothing of a user's
    """
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' file:; media-src 'self' file:"
    head = joined(
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content_=policy),
        element("meta", name_="viewport", content_="width=device-width, initial-scale=1"),
        Html(GENERATOR),
        element("title", title),
        Html(f"<style>\n{insert_colours(style)}</style>"),
    )
    body = element("body", *content)
    return f'<!DOCTYPE html>\n<html lang="en">\n{element("head", head)}\n{body}\n</html>\n'


def _simple(name: str) -> str:
    if not SIMPLE_NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name of an element or an attribute")
    return name


WIDTH, LEFT, RIGHT = 360, 8, 12  # width of a drawing, and its margins: on a telephone a unit is about a pixel
ROW, AXIS = 34, 30
CURVE_LEFT = 34
STEPS = (1.0, 2.0, 5.0)
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Dot:
    """A figure with its interval, and the paper's own; None: there is none."""

    name: str
    value: float | None
    interval: tuple[float | None, float | None] | None = None
    paper: float | None = None


@dataclass(frozen=True)
class _Scale:
    low: float
    high: float
    start: float
    stop: float

    @classmethod
    def fit(cls, values: Iterable[float], start: float, stop: float) -> _Scale:
        known = list(values) or [0.0, 1.0]
        low, high = min(known), max(known)
        margin = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
        return cls(low - margin, high + margin, start, stop)

    def __call__(self, value: float) -> float:
        return self.start + (value - self.low) / (self.high - self.low) * (self.stop - self.start)

    def list_ticks(self, count: int = 5) -> list[float]:
        """Return up to ``count`` round values on the axis."""
        smallest = (self.high - self.low) / count
        power = 10.0 ** np.floor(np.log10(smallest))
        step = next(power * step for step in (*STEPS, 10.0) if power * step >= smallest)
        first = int(np.ceil(self.low / step))
        return [float(step * n) for n in range(first, int(np.floor(self.high / step)) + 1)]


def draw_dots(title: str, unit: str, rows: Sequence[Dot]) -> Html:
    """Return a chart with a line for each row: the figure, its interval, and the paper's own as a diamond."""
    values = [v for row in rows for v in (row.value, row.paper, *(row.interval or ())) if v is not None]
    scale, height = _Scale.fit(values, LEFT, WIDTH - RIGHT), ROW * len(rows) + AXIS + 10
    parts, bottom = [], height - AXIS - 2
    for tick in scale.list_ticks():
        parts.append(_draw_line(scale(tick), 0, scale(tick), bottom, "level"))
        parts.append(_draw_text(scale(tick), bottom + 13, f"{tick:g}", "middle"))
    parts.append(_draw_text(WIDTH - RIGHT, height - 4, unit, "end"))
    for number, row in enumerate(rows):
        y = ROW * number + 26
        parts.append(_draw_text(LEFT, y - 11, row.name, class_="name"))
        low, high = row.interval or (None, None)
        if low is not None and high is not None:
            parts.append(_draw_line(scale(low), y, scale(high), y, "interval"))
        if row.value is not None:
            parts.append(element("circle", cx=f"{scale(row.value):.1f}", cy=str(y), r="4.5", class_="here"))
        if row.paper is not None:
            x = scale(row.paper)
            diamond = f"M{x:.1f} {y - 6}l6 6l-6 6l-6 -6z"
            parts.append(element("path", d=diamond, class_="paper"))
    spoken = "; ".join(f"{row.name} {_spell(row.value)}" for row in rows)
    legend = "Dot and line: here, with its 95 % interval."
    if any(row.paper is not None for row in rows):
        legend += " Diamond: the paper's own figure, of another speaker and other recordings."
    return _frame(title, f"{title}: {spoken}", height, parts, legend)


def draw_rising(title: str, unit: str, lines: Mapping[str, Sequence[tuple[float, Dot]]]) -> Html:
    """Return figures with intervals over a number, on a logarithmic axis: a line for each name."""
    height, bottom = 220, 186
    points = [point for line in lines.values() for point in line if point[1].value is not None]
    up = _Scale.fit([v for _, dot in points for v in (dot.value, *(dot.interval or ())) if v is not None], bottom, 10)
    across = _Scale.fit([float(np.log(n)) for n, _ in points], CURVE_LEFT + 4, WIDTH - RIGHT)
    parts = []
    for tick in up.list_ticks():
        parts.append(_draw_line(CURVE_LEFT, up(tick), WIDTH - RIGHT, up(tick), "level"))
        parts.append(_draw_text(CURVE_LEFT - 4, up(tick) + 4, f"{tick:g}", "end"))
    numbers = sorted({number for number, _ in points})
    parts += [_draw_text(across(float(np.log(n))), bottom + 16, f"{n:g}", "middle") for n in numbers]
    parts.append(_draw_text(WIDTH - RIGHT, height - 5, unit, "end"))
    for order, line in enumerate(lines.values()):
        kind = ("generated", "second")[order % 2]
        known = [(across(float(np.log(n))), dot) for n, dot in line if dot.value is not None]
        places = " ".join(f"{x:.1f},{up(dot.value or 0):.1f}" for x, dot in known)
        parts.append(element("polyline", points=places, class_=kind))
        for x, dot in known:
            low, high = dot.interval or (None, None)
            if low is not None and high is not None:
                parts.append(_draw_line(x + 2 * order, up(low), x + 2 * order, up(high), kind))
            parts.append(element("circle", cx=f"{x:.1f}", cy=f"{up(dot.value or 0):.1f}", r="3", class_=kind))
    looks = ("line", "dashed line")
    legend = "; ".join(f"{looks[order % 2]}: {name}" for order, name in enumerate(lines))
    spelt = {name: ", ".join(f"{n:g} {_spell(dot.value)}" for n, dot in line) for name, line in lines.items()}
    spoken = "; ".join(f"{name}: {text}" for name, text in spelt.items())
    return _frame(title, f"{title}: {spoken}", height, parts, f"{title}. {legend.capitalize()}. Bars: 95 % intervals.")


def _frame(title: str, spoken: str, height: int, parts: Sequence[Html], caption: str) -> Html:
    about = {"viewBox": f"0 0 {WIDTH} {height}", "role": "img", "aria_label": spoken, "class_": "chart"}
    return add_caption(element("svg", element("title", title), *parts, **about), caption)


def add_caption(content: Html, caption: str) -> Html:
    """Return a figure with its caption."""
    return element("figure", content, element("figcaption", caption))


def _draw_line(x1: float, y1: float, x2: float, y2: float, kind: str) -> Html:
    ends = {"x1": x1, "y1": y1, "x2": x2, "y2": y2}
    return element("line", class_=kind, **{name: f"{value:.1f}" for name, value in ends.items()})


def _draw_text(x: float, y: float, text: str, anchor: str = "start", class_: str | None = None) -> Html:
    return element("text", text, x=f"{x:.1f}", y=f"{y:.1f}", text_anchor=anchor, class_=class_)


def _spell(value: float | None) -> str:
    return "not defined" if value is None else f"{value:.3g}"
