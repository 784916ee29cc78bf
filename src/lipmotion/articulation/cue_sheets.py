"""Cue sheets for 2D animation: the mouth shape of every span of time (``units.phones``), chosen from motion.

Of all sequences of held shapes the one with the least total cost is chosen. Which shapes suit a phone says a table of
our own; cue files of other programs name shapes by one of four charts.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import find_phrases
from lipmotion.errors import InputError, shorten
from lipmotion.kernels.paths import find_segments
from lipmotion.motion.closure import frames_within
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import CurveEdit, Generation, Hold, Motion, Span, Timeline, Unit
from lipmotion.types.edits import Locked
from lipmotion.types.values import parse_clock, parse_number
from lipmotion.units import SILENCE, VISEMES, group_words, is_silent, mark_closing_phones
from lipmotion.units.phones import BLAIR, LETTERS, OPTIONAL, REST, SHAPES, choose_drawn_shape

Array = NDArray[np.float64]
LOG = logging.getLogger("lipmotion")

CUES_FPS = 24.0  # frame rate of cues where none is given


@dataclass(frozen=True)
class CueSheet:
    """The cues of one recording.

    cues  : shapes without gaps from 0 to the end, at least one; times are whole hundredths of a second
    fps   : the frame rate that they were chosen for; ``int(fps * start_s)`` is a cue's first frame, the first is 0
    drawn : the shapes that the character has
    words : the words in time, where they are known
    blair : whether shapes have Preston Blair's names where a format has no letters of its own, ``.dat``

    >>> sheet = CueSheet(Timeline((Span(0.0, 0.5, "X"), Span(0.5, 0.62, "A"))), fps=24.0, drawn="ABCDEFX")
    >>> sheet.duration_s, sheet.rest
    (0.62, 'X')
    """

    cues: Timeline[str]
    fps: float
    drawn: str
    words: Timeline[str] = field(default_factory=lambda: Timeline(()))
    blair: bool = True

    @property
    def rest(self) -> str:
        """The shape before and after speech."""
        return choose_drawn_shape(REST, self.drawn)

    @property
    def rows(self) -> list[tuple[float, str]]:
        """Start and shape of every cue, then the end, at which the mouth is at rest."""
        return [*((cue.start_s, cue.label) for cue in self.cues), (self.duration_s, self.rest)]

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.cues.spans[-1].end_s


def frame_to_seconds(frame: int, fps: float) -> float:
    """Return the first hundredth of a second in which a frame is shown.

    Rounded up, so that ``int(fps * start)``, which readers of Rhubarb's and Moho's files compute, is the frame again.
    Frame 1 at 24 fps, 0.0417 s, becomes 0.05 s; rounded to 0.04 s it would be in frame 0. At 100 fps a frame is a
    hundredth, and none is left to round to.
    """
    hundredths = int(np.ceil(frame / fps * 100 - 1e-6))
    return (hundredths + (fps < 100 and int(fps * (hundredths / 100)) < frame)) / 100


def count_cue_frames(end_s: float, fps: float) -> int:
    """Return the number of frames that begin before the end, a whole number of hundredths of a second."""
    frames = int(np.ceil(end_s * fps))
    while frames and frame_to_seconds(frames - 1, fps) >= end_s:
        frames -= 1
    return frames


def list_frame_shapes(sheet: CueSheet) -> list[str]:
    """Return the shape of every frame of the animation, to the end of the sheet."""
    frames = max(1, int(sheet.fps * sheet.duration_s + 1 - 1e-9))
    starts = [min(int(sheet.fps * cue.start_s), frames) for cue in sheet.cues] + [frames]
    shapes: list[str] = []
    for cue, end in zip(sheet.cues, starts[1:], strict=True):
        shapes += [cue.label] * (end - len(shapes))
    return shapes


class PhoneShapes(NamedTuple):
    """The shapes that suit a share of a phone's duration: those that suit best, and those that are acceptable."""

    share: float
    best: str
    allowed: str = ""


@cache
def read_phone_shapes() -> dict[str, list[PhoneShapes]]:
    """Return the table ``phone_shapes.csv``: the shapes that suit each part of a phone, one after the other."""
    shapes: dict[str, list[PhoneShapes]] = {}
    for row in read_shipped_table("lipmotion.articulation", "phone_shapes.csv"):
        for phone in row["phones"].split():
            shapes.setdefault(phone, []).append(PhoneShapes(float(row["share"]), row["best"], row["allowed"]))
    return shapes


def list_phone_shapes(phone: str) -> list[PhoneShapes]:
    """Return the shapes that suit each part of a phone.

    For hh and phones of another inventory the motion alone decides, and the lips stay open; where no phone is known
    (empty), it also decides whether they are open.
    """
    return read_phone_shapes().get(phone, [PhoneShapes(1, "BCDEF" if phone else "ABCDEF")])


COST_RATE_HZ = 24.0
"""Costs are for a frame at this rate and scaled at others, so that the choice does not depend on the rate."""
ALLOWED_COST, OTHER_COST, MISPLACED_COST = 0.5, 1.5, 3.0
"""Cost of a shape that is acceptable for the phone; of one that is not; of one of ``SPECIAL`` for another phone."""
SPECIAL = "AGHX"
OPENING_WEIGHT, SPREAD_WEIGHT = 6.0, 0.5
UNCLOSED_COST, UNBITTEN_COST = 10_000.0, 100.0
"""Cost where the one frame of a p b m, or f v, does not show its shape: where only one fits, p b m win."""
LARGEST_OPENING = 1.2  # largest relative opening that is distinguished
MIN_OPENING = 1e-4
"""Least mean opening, in the unit of the motion, that scales: a mouth that stays closed is not amplified."""
LINE_PAUSE_S, SHORT_S, NEAR_S = 0.5, 1.5, 1.5
"""A longer pause divides lines; one shorter than the second belongs to another one nearer than the third."""
LIP_BITING = VISEMES["ld"]
LEAD_S = 0.02  # the shape of a phone begins this long before its sound

_NAMES = "".join(SHAPES)
_POSES = np.array([(shape.opening, shape.spread) for shape in SHAPES.values()])


def compute_frame_costs(generation: Generation, frames: int, fps: float, intensity: float = 1.0) -> Array:
    """Return the cost of each of ``SHAPES`` in every frame [shape=(frames, 9)]; frame k lasts from ``k / fps`` on."""
    edges_s = np.arange(frames + 1) / fps
    silence = find_phone_values(list_phone_shapes(SILENCE)[0], silent=True)
    bounds_s, sums = [-LEAD_S], [np.zeros_like(silence)]
    for span in generation.units:
        start_s = span.start_s - LEAD_S
        for part in list_phone_shapes(span.label.phone):
            duration_s = part.share * span.duration_s
            bounds_s += [start_s, start_s + duration_s]
            sums += [sums[-1], sums[-1] + duration_s * (find_phone_values(part, is_silent(span.label.phone)) - silence)]
            start_s += duration_s
    phone_values = silence + _average_between(np.array(bounds_s), np.array(sums), edges_s)
    cost, voiced, nominal = phone_values[:, : len(_NAMES)].copy(), phone_values[:, -3], phone_values[:, -2:]
    lines = _split_lines(generation.units, edges_s)
    if "opening" in generation.motion.names:
        opening = _average(generation.motion, "opening", edges_s)
        for line in lines:  # scaled to the nominal openings by least squares; without an offset: closed lips have 0
            wanted = voiced[line] * nominal[line, 0]
            floor = MIN_OPENING * max(float(wanted.sum()), 1.0)
            opening[line] = opening[line] * (wanted @ wanted) / max(float(wanted @ opening[line]), floor)
        opening = np.minimum(intensity * np.clip(opening, 0.0, LARGEST_OPENING), LARGEST_OPENING)
        cost += OPENING_WEIGHT * voiced[:, None] * (opening[:, None] - _POSES[:, 0]) ** 2
    if "width" in generation.motion.names:
        spread, limits = _average(generation.motion, "width", edges_s), (_POSES[:, 1].min(), _POSES[:, 1].max())
        for line in lines:  # predicted from the width by linear regression on the nominal spreads
            total = max(float(voiced[line].sum()), 1e-9)
            mean = float(voiced[line] @ nominal[line, 1]) / total
            centred = spread[line] - float(voiced[line] @ spread[line]) / total
            weighted = voiced[line] * centred
            slope = float(weighted @ (nominal[line, 1] - mean)) / max(float(weighted @ centred), 1e-9)
            spread[line] = np.clip(mean + max(slope, 0.0) * centred, *limits)
        spread = np.clip(intensity * spread, *limits)
        cost += SPREAD_WEIGHT * voiced[:, None] * (spread[:, None] - _POSES[:, 1]) ** 2
    cost *= COST_RATE_HZ / fps
    for span, closes in zip(generation.units, mark_closing_phones(generation.units), strict=True):
        if closes or span.label.phone in LIP_BITING:
            shape, penalty = ("A", UNCLOSED_COST) if closes else ("G", UNBITTEN_COST)
            frame = min(int(_find_least_open_s(span, generation.motion) * fps), frames - 1)
            cost[frame] += penalty
            cost[frame, _NAMES.index(shape)] -= penalty
    return _hold_costs(cost, generation.curve_edits, fps)


def _hold_costs(cost: Array, edits: Sequence[CurveEdit], fps: float) -> Array:
    """Return costs of frames that stay where the mouth is held, whatever is said."""
    held = cost.copy()
    for edit in edits:
        if isinstance(edit, Hold | Locked):
            ends = np.array([edit.start_s, edit.end_s]) * fps
            first, last = np.clip(np.floor(ends + 1e-6), 0, len(cost) - 1).astype(int)
            inside = slice(first, last + 1)
            held[inside] = cost[first] if isinstance(edit, Hold) else _hold_costs(cost, edit.edits, fps)[inside]
    return held


def _find_least_open_s(span: Span[Unit], motion: Motion) -> float:
    """Return the time in a phone at which the mouth is least open; without an opening, the middle of the phone."""
    first, stop = frames_within(span.start_s, span.end_s, motion.rate_hz, len(motion.values))
    if "opening" not in motion.names or first >= stop:
        return max((span.start_s + span.end_s) / 2, 0.0)
    return float((first + int(motion["opening"][first:stop].argmin())) / motion.rate_hz + 1e-9)


def find_phone_values(part: PhoneShapes, silent: bool) -> Array:
    """Return the costs of all shapes in a part of a phone, whether it is speech, opening and spread [shape=(12,)]."""
    costs = [(part.best, 0.0), (part.allowed, ALLOWED_COST), (SPECIAL, MISPLACED_COST), (_NAMES, OTHER_COST)]
    cost = [next(value for names, value in costs if name in names) for name in _NAMES]
    pose = _POSES[[_NAMES.index(name) for name in part.best]].mean(axis=0)
    return np.array([*cost, float(not silent), *pose])


def _split_lines(units: Timeline[Unit], edges_s: Array) -> list[slice]:
    """Return the frames of each line: how far the lips open and spread in one says nothing of another."""
    lines: list[tuple[float, float]] = []
    for start_s, end_s in find_phrases(units, LINE_PAUSE_S):
        before_s, until_s = lines[-1] if lines else (0.0, -np.inf)
        # a short one belongs to a near one, as a word says little of a voice
        if start_s - until_s < NEAR_S and min(end_s - start_s, until_s - before_s) < SHORT_S:
            lines[-1] = before_s, end_s
        else:
            lines.append((start_s, end_s))
    middles = [(before[1] + after[0]) / 2 for before, after in pairwise(lines)]
    bounds = [0, *np.searchsorted(edges_s, middles), len(edges_s) - 1]
    return [slice(first, end) for first, end in pairwise(bounds)]


def _average(motion: Motion, channel: str, edges_s: Array) -> Array:
    """Return the mean of a channel over each frame [shape=(frames,)]; beyond its ends it is constant."""
    grid_s = np.concatenate([motion.time_s, edges_s])
    grid_s.sort()
    values = np.interp(grid_s, motion.time_s, motion[channel])
    sums = np.concatenate([[0.0], np.cumsum(np.diff(grid_s) * (values[1:] + values[:-1]) / 2)])
    return _average_between(grid_s, sums[:, None], edges_s)[:, 0]


def _average_between(time_s: Array, sums: Array, edges_s: Array) -> Array:
    """Return means between edges [shape=(len(edges_s) − 1, columns)] from integrals up to the times ``time_s``."""
    at_edges = np.stack([np.interp(edges_s, time_s, column) for column in sums.T], axis=1)
    return np.diff(at_edges, axis=0) / np.diff(edges_s)[:, None]


CHANGE_COST = 0.35  # cost of a change of shape, in the unit of ``compute_frame_costs``
HOLD_S = 2 / 24  # the shortest hold of a mouth in animation: two frames at 24 fps


def choose_cues(
    generation: Generation,
    fps: float = 24.0,
    hold_frames: int | None = None,
    optional: str = OPTIONAL,
    intensity: float = 1.0,
) -> CueSheet:
    """Return the cues of generated motion.

    fps         : frames per second of the animation, 1 to 100
    hold_frames : minimum length of a cue in frames, > 0; None: nearest to ``HOLD_S``. A shorter recording has one cue
    optional    : which of the shapes G, H and X the character has
    intensity   : openings and spread so many times as large, before shapes are chosen
    The result is exact: of all sequences that keep the hold, the one of least cost (``find_segments``).
    Cost: about 10 µs a frame.
    """
    motion = generation.motion
    drawn = "".join(name for name, shape in SHAPES.items() if not shape.fallback or name in optional)
    duration_s = max(0.0, (len(motion.values) - 1) / motion.rate_hz, *(span.end_s for span in generation.units))
    end_s = int(duration_s * 100 + 1e-6) / 100
    frames = count_cue_frames(end_s, fps)
    cost = np.empty((0, len(drawn)))
    if frames:  # of the drawn shapes: the least cost of those that each one stands for
        costs = compute_frame_costs(generation, frames, fps, intensity)
        groups = [[choose_drawn_shape(other, drawn) == name for other in SHAPES] for name in drawn]
        cost = np.stack([costs[:, group].min(axis=1) for group in groups], axis=1)
    segments = find_segments(cost, hold_frames or max(1, int(HOLD_S * fps + 0.5)), CHANGE_COST)
    rows = [(frame_to_seconds(frame, fps), drawn[label]) for frame, label in segments]
    rows = rows or [(0.0, choose_drawn_shape(REST, drawn))]  # no frame: the mouth is at rest
    ends = [*(start_s for start_s, _ in rows[1:]), end_s]
    cues = tuple(Span(start_s, stop_s, shape) for (start_s, shape), stop_s in zip(rows, ends, strict=True))
    words = tuple(span for span in group_words(generation.units) if span.label)
    return CueSheet(Timeline(cues), fps, drawn, Timeline(words))


FLEMING_DOBBS = {"mbp": "A", "fv": "G", "sh": "F", "o": "E", "ehsz": "C", "aa": "D", "rest": REST}
FLEMING_DOBBS |= dict.fromkeys(("nltdr", "th", "gk", "iy"), "B")
PHONES = {"rest": REST, "hh": "C"} | {
    f"{phone}{stress}": parts[0].best[0] for phone, parts in read_phone_shapes().items() for stress in ("", 0, 1, 2)
}
"""Shapes by the names of other sets, for which Moho and Papagayo have switches."""
OCULUS = {"sil": REST, "pp": "A", "ff": "G", "aa": "D", "e": "C", "oh": "E", "o": "E", "ou": "F", "u": "F"}
OCULUS |= dict.fromkeys("th dd kk ch ss nn rr ih i".split(), "B")
"""Shapes by the names of Meta's 15 visemes (``viseme_PP``), old and new."""
PREFIX = "viseme_"
CHARTS = (BLAIR, LETTERS, FLEMING_DOBBS, OCULUS, PHONES)
LONGEST_S = 86_400.0
MAX_CUES = 250_000
LONGEST_SHAPE_S = 3.0  # longer ones than rest are told, as their times may be frames
MILLISECONDS = 20.0  # shapes other than rest of which half seem to last so many whole seconds are in milliseconds


def parse_shape(name: str, names: dict[str, str], place: str) -> str:
    """Return the shape of a name. Raises InputError: it is none, with its place."""
    shape = names.get(name.strip().lower().removeprefix(PREFIX))
    if shape is None:
        known = " ".join(dict.fromkeys(names))
        raise InputError(f"{place}: no mouth shape is {shorten(name)!r}; the shapes are: {known}")
    return shape


def is_shape(name: str) -> bool:
    """Return whether a shape has the name in one of the sets."""
    return any(name.lower().removeprefix(PREFIX) in chart for chart in CHARTS)


def choose_chart(names: Iterable[str], usual: dict[str, str] = BLAIR) -> dict[str, str]:
    """Return the shapes by the names of the first set that has all: the usual one, or another of ``CHARTS``."""
    wanted = {name.strip().lower().removeprefix(PREFIX) for name in names}
    return next((chart for chart in (usual, *CHARTS) if wanted <= {*chart}), usual)


def parse_cue_time(text: str, place: str) -> float:
    """Return a time in seconds, as 1.5, 1,5 or 0:01.5, or a number of frames. Raises InputError: it is none."""
    value = parse_clock(text)
    if math.isnan(value):
        value = parse_number(text.replace(",", "."), f"{place}: the time is", "a number from 0 on")
    if not 0 <= value <= LONGEST_S * 1000:
        raise InputError(f"{place}: the time is {value:g}, required a number from 0 to {LONGEST_S * 1000:g}")
    return value


def build_cue_sheet(
    rows: Sequence[tuple[float, str]], end_s: float, fps: float, words: Timeline[str] | None = None
) -> CueSheet:
    """Return a sheet of shapes that each last to the next one, with rest before the first.

    rows  : starts in seconds, in order, and shapes;  end_s : of the last one, if it lasts
    Times that are milliseconds are read as these, with a warning.
    Raises InputError: there are none, or too many, or they are not in order.
    """
    if not rows:
        raise InputError("there is no mouth shape in it; export the cues again")
    end_s = max(end_s, rows[-1][0])
    lengths = [after[0] - row[0] for row, after in pairwise([*rows, (end_s, REST)]) if row[1] != REST]
    typical_s = median(lengths or [0.0]) if all(float(start_s).is_integer() for start_s, _ in rows) else 0.0
    if typical_s >= LONGEST_SHAPE_S:
        guess = "the times are taken for milliseconds" if typical_s >= MILLISECONDS else "are its times frames?"
        LOG.warning("a mouth shape seems to last %g s: %s", typical_s, guess)
    if typical_s >= MILLISECONDS:
        rows, end_s = [(start_s / 1000, shape) for start_s, shape in rows], end_s / 1000
    if len(rows) > MAX_CUES or end_s > LONGEST_S:
        raise InputError(f"{len(rows)} mouth shapes in {end_s:g} s, required at most {MAX_CUES} in {LONGEST_S:g} s")
    late = next((place for place, (row, after) in enumerate(pairwise(rows), 1) if after[0] < row[0]), None)
    if late is not None:
        times = f"at {rows[late][0]:.6g} s, the one ahead of it at {rows[late - 1][0]:.6g} s"
        raise InputError(f"mouth shape {late + 1} begins {times}, required in order of time; export the cues again")
    all_rows = [(0.0, REST), *rows] if rows[0][0] > 0 else list(rows)
    ends = [*(start_s for start_s, _ in all_rows[1:]), end_s]
    spans = (Span(start_s, stop_s, shape) for (start_s, shape), stop_s in zip(all_rows, ends, strict=True))
    cues = Timeline(tuple(span for span in spans if span.end_s != span.start_s))
    if not len(cues):
        raise InputError("its mouth shapes last no time; export the cues again")
    return CueSheet(cues, fps, "".join(SHAPES), words or Timeline(()))
