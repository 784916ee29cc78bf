"""Posterior probabilities of the chains of a model over time, and their picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError
from lipmotion.kernels.threads import one_thread
from lipmotion.storage.files import atomic_file, check_target
from lipmotion.types import ChainPosteriors, Generation
from lipmotion.types.audio import Audio
from lipmotion.units import is_silent

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

SUFFIX = ".png"
MAX_COLUMNS = 2000
"""Most columns of a plot; in a longer recording, each column is the mean of several frames."""
MIN_COLUMNS = 600
ROW_PX, GAP_PX, LEFT_PX, RIGHT_PX, TITLE_PX = 16, 14, 120, 16, 20
CURVE_PX = 90
"""Height of the plot of the opening."""
MIN_PROBABILITY = 0.05
"""Units whose posterior probability never reaches this have no row."""
STEPS_S = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60, 120, 300, 600, 1800)
MIN_PHONE_WIDTH = 8
"""Mean pixels per phone that are needed to write the phones."""
MIN_TICK_DISTANCE = 80
"""Least distance between two times on the axis, in pixels."""
WHITE, INK, GREY, PALE = (255, 255, 255), (30, 34, 42), (120, 126, 136), (228, 231, 236)
COLOURS = ((23, 92, 166), (176, 62, 24), (38, 122, 62))
"""The colours of the chains, in their order."""


@one_thread()
def check_picture(path: Path, speech: str | Path | Audio | None = None) -> None:
    """Raise ExportError if a picture cannot be written to a path."""
    if path.suffix.lower() != SUFFIX:
        raise ExportError(f"{path}: unknown format {path.suffix!r}; required: {SUFFIX}")
    check_target(path, None if isinstance(speech, Audio) else speech)


def write_posteriors(path: Path, generation: Generation, posteriors: tuple[ChainPosteriors, ...]) -> None:
    """Write a picture of the posterior probabilities of chains over time (docs/explain.md).

    Raises ExportError: another suffix, or the file cannot be written.
    """
    check_picture(path)
    with atomic_file(path) as unfinished:
        draw_posteriors(generation, posteriors).save(unfinished, optimize=True)


@dataclass(frozen=True)
class TimeAxis:
    """The time axis, from left to right.

    frames  : number of frames of the recording
    rate_hz : their rate
    columns : width of the plot in pixels
    """

    frames: int
    rate_hz: float
    columns: int

    def x(self, time_s: float) -> float:
        """Return the horizontal position of a time, in pixels."""
        return LEFT_PX + float(np.clip(time_s * self.rate_hz / self.frames, 0, 1)) * self.columns

    def averaged(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return values of frames [shape=(T, K)] averaged over each column [shape=(columns, K)]."""
        edges = np.linspace(0, self.frames, self.columns + 1)
        first = np.minimum(edges[:-1].astype(int), self.frames - 1)
        if self.columns < self.frames:
            counts = np.diff([*first, self.frames])
            return np.add.reduceat(values.astype(float), first, axis=0) / counts[:, None]
        return values[first].astype(float)


def draw_posteriors(generation: Generation, posteriors: Sequence[ChainPosteriors]) -> Image.Image:
    """Return a picture of posteriors; from top to bottom: phones, units of each chain, asynchrony, opening, time."""
    from PIL import Image, ImageChops, ImageDraw

    frames, rate_hz = len(generation.motion.values), generation.motion.rate_hz
    axis = TimeAxis(frames, rate_hz, int(np.clip(2 * frames, MIN_COLUMNS, MAX_COLUMNS)))
    panels = []  # of each: title, names of the rows, colours [shape=(columns, rows, 3)]
    for number, chain in enumerate(posteriors):
        highest = chain.probability.max(axis=0)
        units = np.flatnonzero(highest >= min(MIN_PROBABILITY, highest.max()))
        first = (chain.probability[:, units] >= highest[units] / 2).argmax(axis=0)
        units = units[np.argsort(first, kind="stable")]
        colours = _shade(axis, chain.probability[:, units], COLOURS[number % len(COLOURS)])
        panels.append((f"chain {number + 1}: {chain.name}", [chain.units[unit] for unit in units], colours))
        if chain.leads:
            leads = [f"{lead:+d}" if lead else "0" for lead in chain.leads]
            title = f"asynchrony: states that {chain.name} is ahead of {posteriors[0].name}"
            panels.append((title, leads, _shade(axis, chain.lead, INK)))
    channels = generation.motion.names
    curve = "opening" if "opening" in channels else channels[0]
    height = 4 * TITLE_PX + CURVE_PX + sum(TITLE_PX + ROW_PX * len(names) + GAP_PX for _, names, _ in panels)
    picture = Image.new("RGB", (LEFT_PX + axis.columns + RIGHT_PX, height), WHITE)
    pen = PlotPainter(ImageDraw.Draw(picture), axis)
    pen.phones(generation, height - 2 * TITLE_PX)
    y = TITLE_PX
    for title, names, colours in panels:
        pen.text(LEFT_PX, y + 2, title, INK)
        y += TITLE_PX
        pen.rows(y, names)
        area = (LEFT_PX, y, LEFT_PX + axis.columns, y + ROW_PX * len(names))
        band = Image.fromarray(colours.transpose(1, 0, 2)).resize((axis.columns, ROW_PX * len(names)), 0)
        picture.paste(ImageChops.darker(band, picture.crop(area)), area)
        y += ROW_PX * len(names) + GAP_PX
    pen.text(LEFT_PX, y + 2, f"{curve} (generated)", INK)
    pen.curve(y + TITLE_PX, generation.motion[curve])
    pen.times(y + TITLE_PX + CURVE_PX)
    return picture


def _shade(axis: TimeAxis, probability: NDArray[Any], colour: tuple[int, int, int]) -> NDArray[np.uint8]:
    share = np.clip(axis.averaged(probability), 0, 1)[:, :, None]
    return np.round(255 + share * (np.array(colour, float) - 255)).astype(np.uint8)


@dataclass(frozen=True)
class PlotPainter:
    """Draws texts, lines and curves."""

    on: ImageDraw.ImageDraw
    axis: TimeAxis

    @cached_property
    def font(self) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
        """The font of all texts."""
        from PIL import ImageFont

        return ImageFont.load_default(12)

    def text(self, x: float, y: float, text: str, colour: tuple[int, int, int], anchor: str = "la") -> None:
        """Write a text at a position."""
        self.on.text((x, y), text, fill=colour, font=self.font, anchor=anchor)

    def rows(self, y: float, names: Sequence[str]) -> None:
        """Write the names of rows, and draw lines between them."""
        right = LEFT_PX + self.axis.columns
        for number, name in enumerate(names):
            self.on.line([(LEFT_PX, y + ROW_PX * number), (right, y + ROW_PX * number)], fill=PALE)
            self.text(LEFT_PX - 6, y + ROW_PX * (number + 0.5), name, INK, "rm")
        self.on.rectangle([LEFT_PX, y, right, y + ROW_PX * len(names)], outline=GREY)

    def curve(self, y: float, values: NDArray[Any]) -> None:
        """Draw a curve [shape=(T,)] with its least and largest value."""
        shown = values if len(values) < self.axis.columns else self.axis.averaged(values[:, None])[:, 0]
        low, high = float(min(shown.min(), 0)), float(shown.max())
        heights = y + CURVE_PX - (shown - low) / max(high - low, 1e-9) * (CURVE_PX - 8)
        positions = LEFT_PX + (np.arange(len(shown)) + 0.5) / len(shown) * self.axis.columns
        self.on.rectangle([LEFT_PX, y, LEFT_PX + self.axis.columns, y + CURVE_PX], outline=GREY)
        self.on.line(list(zip(positions.tolist(), heights.tolist(), strict=True)), fill=INK, width=2)
        self.text(LEFT_PX - 6, y + 8, f"{high:.2f}", INK, "rm")
        self.text(LEFT_PX - 6, y + CURVE_PX, f"{low:.2f}", INK, "rm")

    def phones(self, generation: Generation, bottom: float) -> None:
        """Write the phones at the top, and draw lines where they begin, if there is room for them."""
        if len(generation.units) * MIN_PHONE_WIDTH > self.axis.columns:
            return
        free = 0.0
        for span in generation.units:
            left, right = self.axis.x(span.start_s), self.axis.x(span.end_s)
            self.on.line([(left, TITLE_PX - 4), (left, bottom)], fill=PALE)
            width = self.on.textlength(span.label.phone, font=self.font)
            start = (left + right - width) / 2
            if start > free:
                self.text(start, 3, span.label.phone, GREY if is_silent(span.label.phone) else INK)
                free = start + width + 2

    def times(self, y: float) -> None:
        """Draw the time axis."""
        length_s = self.axis.frames / self.axis.rate_hz
        step_s = next((s for s in STEPS_S if s / length_s * self.axis.columns >= MIN_TICK_DISTANCE), STEPS_S[-1])
        for number in range(int(length_s / step_s) + 1):
            x = self.axis.x(number * step_s)
            self.on.line([(x, y), (x, y + 5)], fill=INK)
            self.text(x, y + 8, f"{number * step_s:g} s", INK, "ma")
