"""Times of a transcript, as of subtitles, bound its alignment: the frames in which each word may lie."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.align import PlacedWord
from lipmotion.kernels.paths import Windows
from lipmotion.types import FRAME_RATE_HZ, TimedTranscript

LOG = logging.getLogger("lipmotion")
LINE_TOLERANCE_S, WORD_TOLERANCE_S = 0.5, 0.25
"""By how much lines and words may be earlier or later than their times, at first."""
WIDENING_FACTORS, MIN_IMPROVEMENT = (2, 4, 8, 16), 0.2
"""Where words press against their windows or fit badly, the tolerance is widened by these factors in turn; it stays
wider where the words then fit better by this many nats a frame."""
LEAD_S, TAIL_S, REACH_S = 0.2, 0.4, 0.1
"""A word begins so long before its first sound is heard at most, and ends so long after its last one, for a network
hears each sound once, drawn-out ones somewhere within them; what it hears may be off by the third."""
BAD_FIT, WORST_FIT = -3.5, -6.0
"""Words that fit worse than the first, in nats a frame, may be elsewhere; worse than the second, they are not there."""
FREE_FRAMES = 60_000  # recordings of up to ten minutes are aligned without times where these belong to something else
NEIGHBOURS = 3  # words on each side of one without room whose windows are widened too, with all that share its time
Placed = list[PlacedWord]
MAX_WIDENINGS = 40  # doublings of windows without room; then every word may lie anywhere


@dataclass(frozen=True, eq=False)
class Anchors:
    """Times of words [each of shape=(W,)]."""

    start_s: NDArray[np.float64]  # NaN where it is not known
    end_s: NDArray[np.float64]  # NaN where it is not known
    tolerance_s: NDArray[np.float64]  # by how much the word may be earlier or later
    groups: NDArray[np.intp]  # number of the word's time, which other words of its line may share
    heard: bool = False  # the words were heard there: no fit is better elsewhere


def find_anchors(transcript: TimedTranscript) -> Anchors:
    """Return the times of the words of a transcript.

    Words have the times of their line; if some words of a line have times of their own, the others lie between these.
    """
    rows: list[tuple[float | None, float | None, float]] = []
    for line in transcript.lines:
        has_times = any(word.start_s is not None or word.end_s is not None for word in line.words)
        for place, word in enumerate(line.words):
            timed = word.start_s is not None or word.end_s is not None
            start_s = line.start_s if word.start_s is None and (not has_times or place == 0) else word.start_s
            last = place == len(line.words) - 1
            end_s = line.end_s if word.end_s is None and (not has_times or last) else word.end_s
            rows.append((start_s, end_s, WORD_TOLERANCE_S if timed else LINE_TOLERANCE_S))
    table = np.array(rows, float).reshape(-1, 3)  # None becomes NaN
    differs = ~np.isclose(table[1:, :2], table[:-1, :2], equal_nan=True).all(axis=1)
    return Anchors(table[:, 0], table[:, 1], table[:, 2], np.append(0, np.cumsum(differs)))


def bound_words(heard_s: Sequence[tuple[float, float]]) -> Anchors:
    """Return times of words that a phone recogniser hears: between the words beside them, and near to these sounds.

    heard_s : start and end of each word in seconds
    """
    starts_s, ends_s = np.array(heard_s, float).reshape(-1, 2).T
    first_s = np.fmax(np.append(np.nan, ends_s[:-1]), starts_s - LEAD_S)
    last_s = np.fmin(np.append(starts_s[1:], np.nan), ends_s + TAIL_S)
    return Anchors(first_s, last_s, np.full(len(first_s), REACH_S), np.arange(len(first_s)), heard=True)


def leave_out_late_lines(transcript: TimedTranscript, duration_s: float) -> TimedTranscript:
    """Return a transcript without the lines that begin after the end of a recording; a warning says so.

    Raises InputError: all lines begin after the end.
    """
    latest_s = duration_s + LINE_TOLERANCE_S
    lines = [line for line in transcript.lines if line.start_s is None or line.start_s <= latest_s]
    if not lines:
        what = f"the transcript begins at {transcript.lines[0].start_s:.2f} s, the recording ends at {duration_s:.2f} s"
        raise InputError(f"{what}; give the transcript of this recording")
    if left_out := len(transcript.lines) - len(lines):
        what = "the transcript goes on after the recording ends at %.2f s; its last %d lines are left out"
        LOG.warning(what, duration_s, left_out)
    return TimedTranscript(tuple(lines))


def make_windows(anchors: Anchors, tolerance_s: NDArray[np.float64], frames: int) -> Windows:
    """Return the frames in which each word may lie.

    An untimed word may lie from the timed word before to the one after. No word may begin before those ahead of it
    may, nor end after those behind it may; out of order, times leave no room (``find_windows``).
    """
    first = np.floor((anchors.start_s - tolerance_s) * FRAME_RATE_HZ)
    end = np.ceil((anchors.end_s + tolerance_s) * FRAME_RATE_HZ) + 1
    first, end = _carry_forward(first, 0.0), _carry_forward(end[::-1], float(frames))[::-1]
    first, end = np.maximum.accumulate(first), np.minimum.accumulate(end[::-1])[::-1]
    return Windows(np.clip(first, 0, frames).astype(np.intp), np.clip(end, 0, frames).astype(np.intp))


def _carry_forward(values: NDArray[np.float64], before: float) -> NDArray[np.float64]:
    """Return values with unknown ones replaced by the last known one before; ``before`` where there is none."""
    known = np.append(True, ~np.isnan(values))
    latest = np.maximum.accumulate(np.where(known, np.arange(len(known)), 0))
    return np.append(before, values)[latest][1:]


def find_windows(
    anchors: Anchors, tolerance_s: NDArray[np.float64], min_frames: NDArray[np.intp], edge: int, frames: int
) -> tuple[Windows, NDArray[np.float64]]:
    """Return windows in which all words have room, and the tolerances, doubled around words that had none.

    min_frames : the fewest frames of each word
    edge  : the fewest frames of the silence at both ends
    If there is no room after ``MAX_WIDENINGS``, the windows are the whole recording.
    """
    for _ in range(MAX_WIDENINGS):
        windows = make_windows(anchors, tolerance_s, frames)
        crowded = np.zeros(len(min_frames), bool)
        earliest = edge
        ends = np.minimum(windows.end, frames - edge).tolist()
        for word, (first, end, count) in enumerate(zip(windows.first.tolist(), ends, min_frames.tolist(), strict=True)):
            begin = max(first, earliest)
            crowded[word] = begin + count > end
            earliest = min(begin + count, max(end, first))  # the words after it are judged as if it had room
        if not crowded.any():
            return windows, tolerance_s
        near = np.isin(anchors.groups, anchors.groups[crowded])
        if len(crowded) > 2 * NEIGHBOURS:
            near |= np.convolve(crowded, np.ones(2 * NEIGHBOURS + 1), "same") > 0
        tolerance_s = np.where(near, 2 * tolerance_s, tolerance_s)
    tolerance_s = np.full(len(min_frames), np.inf)
    return make_windows(anchors, tolerance_s, frames), tolerance_s


def find_pressed_words(placed: Sequence[PlacedWord], windows: Windows, frames: int) -> NDArray[np.bool_]:
    """Return which words begin with their window, or end with it: they might belong outside [shape=(W,)]."""
    pressed = np.zeros(len(windows.first), bool)
    ends = [item.start for item in placed[1:]] + [frames]
    for item, stop in zip(placed, ends, strict=True):
        word = item.spoken.word
        if word >= 0:
            first, end = windows.first[word], windows.end[word]
            pressed[word] = (0 < first == item.start) or (frames > end == stop)
    return pressed


def average_fits(placed: Sequence[PlacedWord], groups: NDArray[np.intp], frames: int) -> NDArray[np.float64]:
    """Return the fit of the words of each time, the mean over their frames [shape=(groups,)]."""
    words = np.array([item.spoken.word for item in placed], np.intp)
    lengths = np.diff([*(item.start for item in placed), frames])[words >= 0]
    fits, numbers = np.array([item.fit for item in placed])[words >= 0], groups[words[words >= 0]]
    count = np.bincount(numbers, lengths, groups[-1] + 1)
    return np.bincount(numbers, fits * lengths, groups[-1] + 1) / np.maximum(count, 1)


def align_within(
    anchors: Anchors, min_frames: NDArray[np.intp], edge: int, frames: int, search: Callable[[Windows], Placed]
) -> tuple[Placed, Windows]:
    """Return words aligned within their windows, and these.

    min_frames, edge : as of ``find_windows``
    search      : aligns within windows, with the fit of each word
    Where words press against their windows, or fit badly, these are widened step by step, and stay so if the words then
    fit better by ``MIN_IMPROVEMENT``: words also press where speech beside them is not in the transcript. If all fit
    badly even so, the words of a recording of up to ``FREE_FRAMES`` are aligned without times; if they fit better then,
    the times are not used. What fits badly in the end is logged as a warning.
    """

    def place_words(tolerance_s: NDArray[np.float64]) -> tuple[Placed, Windows, NDArray[np.float64]]:
        windows, tolerance_s = find_windows(anchors, tolerance_s, min_frames, edge, frames)
        return search(windows), windows, tolerance_s

    placed, windows, tolerance_s = place_words(anchors.tolerance_s)
    if anchors.heard:
        return placed, windows
    for factor in WIDENING_FACTORS:
        fits = average_fits(placed, anchors.groups, frames)
        wider_s = np.maximum(factor * anchors.tolerance_s, tolerance_s)
        doubted = fits < BAD_FIT
        doubted[anchors.groups[find_pressed_words(placed, windows, frames)]] = True
        doubted &= np.isin(np.arange(len(fits)), anchors.groups[tolerance_s < wider_s])
        if not doubted.any():
            break
        wide = place_words(np.where(doubted[anchors.groups], wider_s, tolerance_s))
        gain = average_fits(wide[0], anchors.groups, frames) - fits
        better = doubted & (np.maximum(gain, _average_neighbours(gain)) >= MIN_IMPROVEMENT)
        if (better == doubted).all():
            placed, windows, tolerance_s = wide
        elif better.any():
            placed, windows, tolerance_s = place_words(np.where(better[anchors.groups], wider_s, tolerance_s))
    together = np.zeros(len(anchors.groups), np.intp)
    fit = average_fits(placed, together, frames)[0]
    if fit < BAD_FIT and frames <= FREE_FRAMES:
        everywhere = Windows(together, np.full(len(together), frames, np.intp))
        free = search(everywhere)
        if average_fits(free, together, frames)[0] >= fit + MIN_IMPROVEMENT:
            LOG.warning("the times of the transcript do not fit the sound; they are not used")
            return free, everywhere
    last_fits = average_fits(placed, anchors.groups, frames)
    wrong = np.flatnonzero(_average_neighbours(last_fits) < WORST_FIT)
    if len(wrong):
        known = anchors.start_s[(anchors.groups <= int(wrong[0])) & ~np.isnan(anchors.start_s)]
        what = "at %d of the %d times of the transcript the words do not fit the sound, first at %.2f s; check them"
        LOG.warning(what, len(wrong), len(last_fits), float(known[-1]) if len(known) else 0.0)
    return placed, windows


def _average_neighbours(values: NDArray[np.float64]) -> NDArray[np.float64]:
    count = np.convolve(np.ones(len(values)), np.ones(3))[1:-1]
    return np.convolve(values, np.ones(3))[1:-1] / count
