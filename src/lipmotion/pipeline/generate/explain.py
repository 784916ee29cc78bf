"""What determined frames of motion: ``explain(speech, at=…)``, ``state_runs(speech)``; their text and JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import ENGINES, Engine
from lipmotion.engines.base import explain_by_trace
from lipmotion.errors import InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.edits import Edits
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.generation import map_explanation
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import SpeechInput, as_request
from lipmotion.pipeline.session import NO_EDITS, Session
from lipmotion.printable import printable
from lipmotion.types import (
    FRAME_RATE_HZ,
    ChainPosteriors,
    ChannelValue,
    Explanation,
    Generation,
    NamedProbability,
    SpeechPart,
    frame_of,
)
from lipmotion.units import is_silent

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

LONGEST_STATE_CHARACTERS = 110
"""Most characters of a state in a line of text."""
LINE = 110
"""Width of the text of a row, without its name, in characters."""
SHOWN_CHANNELS = 6
"""Largest number of channels in a text; points are left out if there are other channels."""


def explain(
    speech: SpeechInput,
    *,
    at: float | Sequence[float],
    model: Model | str | Path | None = None,
    transcript: str | Path | None = None,
) -> tuple[Explanation, ...]:
    """Return what determined some frames of the motion that ``animate`` generates for the same speech.

    speech, transcript : as of ``animate``
    at    : one or several times, in seconds; the nearest 10 ms frame of each is explained
    model : from ``load_model``, or the path of a model file; None: the shipped model
    Raises InputError: a time lies outside the recording; else as ``animate``.
    Raises AlignmentError: the transcript cannot be aligned with the recording.

    >>> import lipmotion
    >>> first, second = lipmotion.explain("examples/welcome.flac", at=[0.0, 1.0])
    >>> first.state, second.frame
    ('rest', 100)
    """
    session = Session(as_request(speech, transcript), model=model)
    return explain_session(session, NO_EDITS, [at] if isinstance(at, int | float) else at)


@limit_threads()
def explain_session(session: Session, edits: Edits, times: Sequence[float]) -> tuple[Explanation, ...]:
    """Return what determined the frames nearest to some times, in seconds, of a session's motion with some edits.

    Of what pins, gains and locks change it says nothing: it is what the model did with the phones.
    Raises InputError: a time lies outside the recording; else as ``Session.generate``.
    """
    speech = session.analyse(edits).speech
    count = len(speech.features.values)
    places = [(time_s, frame_of(time_s, count, FRAME_RATE_HZ)) for time_s in times]
    for time_s, frame in places:
        if frame is None:
            raise InputError(f"{time_s} s lies outside the recording (0 to {(count - 1) / FRAME_RATE_HZ:.2f} s)")
    generation, explanations = session.generate(edits), []
    parts = speech.parts if speech.parts is not None else [SpeechPart(0, slice(0, count), speech)]
    for frame in (frame for _, frame in places if frame is not None):
        first, part = next(
            ((each.first, each.speech) for each in parts if each.own.start <= frame < each.own.stop),
            (frame + 1, speech),
        )
        by_engine = None
        if 0 <= frame - first < len(part.features.values):  # not in the silence between passages
            part = replace(part, times_given=speech.times_given)
            by_engine = session.model.engine.explain(session.model.learned, part, [frame - first])
        if by_engine is None:
            explanation = explain_by_trace(generation, frame)
        else:  # with the times of its passage
            explanation = map_explanation(session.speaker, by_engine[0], part)
            offset_s, span = first / FRAME_RATE_HZ, explanation.span
            if span is not None:
                span = replace(span, start_s=max(span.start_s + offset_s, 0.0), end_s=span.end_s + offset_s)
            explanation = replace(explanation, time_s=explanation.time_s + offset_s, frame=frame, span=span)
        if generation.confidence is not None:
            explanation = replace(explanation, confidence=float(generation.confidence[frame]))
        explanations.append(explanation)
    return tuple(explanations)


def write_document(explanation: Explanation) -> dict[str, Any]:
    """Return an explanation as an object of JSON (docs/explain.md)."""
    document = asdict(explanation)
    for written, chain in zip(document["chains"], explanation.chains, strict=True):
        if chain.lead:
            written["expected_lead"] = chain.expected_lead
    return document


def write_explanation(explanation: Explanation) -> str:
    """Return an explanation as lines of text for people to read."""
    rows = list(_rows(explanation))
    width = max(len(name) for name, _ in rows) + 2
    lines = [f"{explanation.time_s:.2f} s (frame {explanation.frame})"]
    for name, text in rows:
        first, *others = wrap(text, LINE, break_long_words=False, break_on_hyphens=False) or [""]
        lines += [f"  {name:{width}}{first}", *(f"  {'':{width}}{other}" for other in others)]
    return "\n".join(map(printable, lines))


def _rows(explanation: Explanation) -> Iterator[tuple[str, str]]:
    phone, span = "none", explanation.span
    if span is not None:
        word = f" in {span.label.word!r}" if span.label.word else ""
        times = f"{span.start_s:.2f} to {span.end_s:.2f} s"
        phone = f"{span.label.phone or 'not known'}{word}, {times}, modelled by {span.label.unit}"
    yield "phone", phone
    yield "state", explanation.state
    for number, chain in enumerate(explanation.chains):
        yield f"chain {number + 1}: {chain.name}", _list_probabilities(chain.states)
    if explanation.joint is not None and len(explanation.chains) > 1:
        yield "together", _list_probabilities([explanation.joint])
    for chain in explanation.chains:
        if chain.lead:
            shares = (
                f"{states:+d}: {share:.2f}" if states else f"0: {share:.2f}" for states, share in chain.lead.items()
            )
            side = f"states {'ahead of' if chain.expected_lead >= 0 else 'behind'} {explanation.chains[0].name}"
            yield "asynchrony", f"{chain.name} {abs(chain.expected_lead):.2f} {side}   ({'   '.join(shares)})"
    for gaussian in explanation.gaussians:
        which = f" number {gaussian.component} of {gaussian.components}" if gaussian.components > 1 else ""
        distance = f", {gaussian.distance:.2f} deviations away" if gaussian.distance is not None else ""
        text = f"{gaussian.density}{which}, responsible for {gaussian.responsibility:.2f}{distance}"
        yield f"Gaussian of {gaussian.stream}", text
        yield from _list_values(gaussian.channels)
    values = _list_values(explanation.motion)
    yield "generated", next(values)[1]
    yield from values
    if explanation.confidence is not None:
        yield "confidence", f"{explanation.confidence:.2f}"


def _list_probabilities(probabilities: Sequence[NamedProbability]) -> str:
    return "   ".join(f"{item.name} {item.probability:.2f}" for item in probabilities)


def _list_values(channels: Mapping[str, ChannelValue]) -> Iterator[tuple[str, str]]:
    names = [name for name in channels if name[:2] not in ("x_", "y_", "z_")] or list(channels)
    for start in range(0, min(len(names), SHOWN_CHANNELS), 3):
        shown = names[start : min(start + 3, SHOWN_CHANNELS)]
        text = "   ".join(f"{name} {channels[name].value:6.3f} ± {channels[name].deviation:.3f}" for name in shown)
        yield "", text
    if len(channels) > min(len(names), SHOWN_CHANNELS):
        yield "", f"and {len(channels) - min(len(names), SHOWN_CHANNELS)} more channels (--json has all)"


@limit_threads()
def chain_posteriors(session: Session, edits: Edits) -> tuple[Generation, tuple[ChainPosteriors, ...]]:
    """Return the motion of a session with some edits, and the posterior probabilities of every chain of its model.

    Raises InputError: as ``Session.generate``, or the model's engine has no chains of states.
    """
    engine, learned = session.model.engine, session.model.learned
    if type(engine).posteriors is Engine.posteriors:
        having = [name for name in ENGINES.names if ENGINES.load(name).posteriors is not Engine.posteriors]
        raise InputError(
            f"the engine {engine.name!r} has no chains of states whose posteriors could be shown; give a model that "
            f"was trained with --engine {' or '.join(having)}"
        )
    return session.generate(edits), engine.posteriors(learned, session.analyse(edits).speech)


@dataclass(frozen=True)
class StateRun:
    """Consecutive frames of generated motion behind which stands one state of the model.

    start_s, end_s : seconds; the frames are centred at times from ``start_s`` (included) to ``end_s`` (excluded)
    phone, word    : which take most of the run; empty: none, or not known
    state          : as in ``Generation.trace``; of the engine ``selection`` it names a recording and the times in it
    """

    start_s: float
    end_s: float
    phone: str
    word: str
    state: str


def state_runs(
    speech: SpeechInput, *, model: Model | str | Path | None = None, transcript: str | Path | None = None
) -> tuple[StateRun, ...]:
    """Return which state of the model stands behind every frame of the motion that ``animate`` generates.

    speech, model, transcript : as of ``animate``
    Returns the runs of frames with one state, in order and without gaps.
    Raises InputError, AlignmentError: as ``animate``.

    >>> import lipmotion
    >>> runs = lipmotion.state_runs("examples/welcome.flac")
    >>> runs[0].start_s, runs[0].state, runs[0].end_s == runs[1].start_s
    (0.0, 'rest', True)
    """
    return list_runs(animate(speech, model=model, transcript=transcript))


def list_runs(generation: Generation) -> tuple[StateRun, ...]:
    """Return the runs of frames with one state of generated motion."""
    frames, rate_hz = generation.trace.frames, generation.motion.rate_hz
    firsts = [0, *(np.flatnonzero(np.diff(frames)) + 1).tolist()] if len(frames) else []
    times_s = [first / rate_hz for first in (*firsts, len(frames))]
    spans, number = generation.units.spans, 0
    runs = []
    for first, start_s, end_s in zip(firsts, times_s, times_s[1:], strict=False):
        while number < len(spans) and spans[number].end_s <= start_s:
            number += 1
        longest_s, phone, word = 0.0, "", ""
        for span in spans[number:]:
            if span.start_s >= end_s:
                break
            shared_s = min(span.end_s, end_s) - max(span.start_s, start_s)
            if shared_s > longest_s:
                longest_s, phone, word = shared_s, span.label.phone, span.label.word
        runs.append(StateRun(start_s, end_s, phone, word, generation.trace.states[frames[first]]))
    return tuple(runs)


def run_lines(runs: Sequence[StateRun], count: int) -> Iterator[str]:
    """Yield runs as lines of text for people to read, the first ``count`` of them, with a title."""
    shown = runs[: max(count, 0)]
    width = max([len("word"), *(len(printable(run.word)) for run in shown)])
    yield f"{'from':>8} {'to':>8}  phone  {'word':{width}}  state"
    for run in shown:
        state = run.state[:LONGEST_STATE_CHARACTERS] + "..." * (len(run.state) > LONGEST_STATE_CHARACTERS)
        yield f"{run.start_s:8.2f} {run.end_s:8.2f}  {run.phone:5}  {run.word:{width}}  {state}"
    if len(runs) > len(shown):
        yield f"and {len(runs) - len(shown)} more (--count N prints N, --json all)"


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


def draw_posteriors(generation: Generation, posteriors: Sequence[ChainPosteriors]) -> Image.Image:
    """Return a picture of the posterior probabilities of chains over time (docs/explain.md).

    From top to bottom: phones, units of each chain, asynchrony, opening, time.
    """
    from PIL import Image, ImageChops, ImageDraw

    frames, rate_hz = len(generation.motion.values), generation.motion.rate_hz
    columns = int(np.clip(2 * frames, MIN_COLUMNS, MAX_COLUMNS))
    panels = []  # of each: title, names of the rows, probabilities [shape=(T, rows)], colour
    for number, chain in enumerate(posteriors):
        highest = chain.probability.max(axis=0)
        units = np.flatnonzero(highest >= min(MIN_PROBABILITY, highest.max()))
        first = (chain.probability[:, units] >= highest[units] / 2).argmax(axis=0)
        units = units[np.argsort(first, kind="stable")]
        title, names = f"chain {number + 1}: {chain.name}", [chain.units[unit] for unit in units]
        panels.append((title, names, chain.probability[:, units], COLOURS[number % len(COLOURS)]))
        if chain.leads:
            leads = [f"{lead:+d}" if lead else "0" for lead in chain.leads]
            title = f"asynchrony: states that {chain.name} is ahead of {posteriors[0].name}"
            panels.append((title, leads, chain.lead, INK))
    channels = generation.motion.names
    curve = "opening" if "opening" in channels else channels[0]
    height = 4 * TITLE_PX + CURVE_PX + sum(TITLE_PX + ROW_PX * len(names) + GAP_PX for _, names, *_ in panels)
    picture = Image.new("RGB", (LEFT_PX + columns + RIGHT_PX, height), WHITE)
    pen = PlotPainter(ImageDraw.Draw(picture), frames, rate_hz, columns)
    pen.phones(generation, height - 2 * TITLE_PX)
    y = TITLE_PX
    for title, names, probability, colour in panels:
        pen.text(LEFT_PX, y + 2, title, INK)
        y += TITLE_PX
        pen.rows(y, names)
        area = (LEFT_PX, y, LEFT_PX + columns, y + ROW_PX * len(names))
        share = np.clip(pen.averaged(probability), 0, 1)[:, :, None]
        shades = np.round(255 + share * (np.array(colour, float) - 255)).astype(np.uint8)
        band = Image.fromarray(shades.transpose(1, 0, 2)).resize((columns, ROW_PX * len(names)), 0)
        picture.paste(ImageChops.darker(band, picture.crop(area)), area)
        y += ROW_PX * len(names) + GAP_PX
    pen.text(LEFT_PX, y + 2, f"{curve} (generated)", INK)
    pen.curve(y + TITLE_PX, generation.motion[curve])
    pen.times(y + TITLE_PX + CURVE_PX)
    return picture


@dataclass(frozen=True)
class PlotPainter:
    """Draws texts, lines and curves over time, from left to right.

    frames, rate_hz : of the recording
    columns         : width of the plot in pixels
    """

    on: ImageDraw.ImageDraw
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
        right = LEFT_PX + self.columns
        for number, name in enumerate(names):
            self.on.line([(LEFT_PX, y + ROW_PX * number), (right, y + ROW_PX * number)], fill=PALE)
            self.text(LEFT_PX - 6, y + ROW_PX * (number + 0.5), name, INK, "rm")
        self.on.rectangle([LEFT_PX, y, right, y + ROW_PX * len(names)], outline=GREY)

    def curve(self, y: float, values: NDArray[Any]) -> None:
        """Draw a curve [shape=(T,)] with its least and largest value."""
        shown = values if len(values) < self.columns else self.averaged(values[:, None])[:, 0]
        low, high = float(min(shown.min(), 0)), float(shown.max())
        heights = y + CURVE_PX - (shown - low) / max(high - low, 1e-9) * (CURVE_PX - 8)
        positions = LEFT_PX + (np.arange(len(shown)) + 0.5) / len(shown) * self.columns
        self.on.rectangle([LEFT_PX, y, LEFT_PX + self.columns, y + CURVE_PX], outline=GREY)
        self.on.line(list(zip(positions.tolist(), heights.tolist(), strict=True)), fill=INK, width=2)
        self.text(LEFT_PX - 6, y + 8, f"{high:.2f}", INK, "rm")
        self.text(LEFT_PX - 6, y + CURVE_PX, f"{low:.2f}", INK, "rm")

    def phones(self, generation: Generation, bottom: float) -> None:
        """Write the phones at the top, and draw lines where they begin, if there is room for them."""
        if len(generation.units) * MIN_PHONE_WIDTH > self.columns:
            return
        free = 0.0
        for span in generation.units:
            left, right = self.x(span.start_s), self.x(span.end_s)
            self.on.line([(left, TITLE_PX - 4), (left, bottom)], fill=PALE)
            width = self.on.textlength(span.label.phone, font=self.font)
            start = (left + right - width) / 2
            if start > free:
                self.text(start, 3, span.label.phone, GREY if is_silent(span.label.phone) else INK)
                free = start + width + 2

    def times(self, y: float) -> None:
        """Draw the time axis."""
        length_s = self.frames / self.rate_hz
        step_s = next((s for s in STEPS_S if s / length_s * self.columns >= MIN_TICK_DISTANCE), STEPS_S[-1])
        for number in range(int(length_s / step_s) + 1):
            x = self.x(number * step_s)
            self.on.line([(x, y), (x, y + 5)], fill=INK)
            self.text(x, y + 8, f"{number * step_s:g} s", INK, "ma")
