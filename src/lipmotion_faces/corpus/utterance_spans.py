"""Dividing a long recording into utterances of a few seconds: at pauses, at cuts, between lines of a transcript."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

SHORTEST_S, LONGEST_S = 3.0, 12.0
"""Wanted length of an utterance. Longer ones are divided at their longest pause, shorter ones joined where they can."""
LEAST_S = 0.8
"""Shorter pieces are left out."""
LONGEST_PAUSE_S = 1.0
"""A longer pause always divides, and is left out except for its edges."""
MARGIN_S = 0.3
"""Silence kept before and after an utterance, at most half of the pause: lips begin before the sound."""
ROUNDING_S = 0.05
"""A cut that is this close to the end of a stretch does not divide it."""

Quietest = Callable[[float, float], float]
"""Returns the time of the lowest level between two times."""


@dataclass(frozen=True)
class SpokenPart:
    """A part of a recording that is not divided by a pause: between two silences, or a line of a transcript.

    start_s, end_s : seconds
    words          : what is said in it, or None where it is not known
    """

    start_s: float
    end_s: float
    words: tuple[str, ...] | None = None

    @property
    def duration_s(self) -> float:
        """Duration in seconds."""
        return self.end_s - self.start_s


def utterance_spans(
    stretches: Sequence[SpokenPart], cuts_s: Sequence[float], duration_s: float, quietest: Quietest
) -> list[SpokenPart]:
    """Return the utterances of a recording, in order, without overlap.

    stretches  : parts with speech, in order; those with words are never divided
    cuts_s     : times at which the camera changes, rising; utterances without words are divided there
    duration_s : of the recording
    quietest   : finds the best place to divide where there is no pause
    Between neighbours, the pause is shared; of one longer than twice ``MARGIN_S``, the middle belongs to nobody.
    """
    groups: list[list[SpokenPart]] = []
    for stretch in _separate_overlaps(stretches):
        edges = [stretch.start_s, stretch.end_s]
        if stretch.words is None:
            edges[1:1] = [t for t in cuts_s if stretch.start_s + ROUNDING_S < t < stretch.end_s - ROUNDING_S]
        for start_s, end_s in pairwise(edges):
            for part in _divide_speech(replace(stretch, start_s=start_s, end_s=end_s), quietest):
                before = groups[-1][-1] if groups else None
                is_pause = before is not None and part.start_s - before.end_s <= LONGEST_PAUSE_S
                if before is not None and is_pause and not _is_cut_between(before, part, cuts_s):
                    groups[-1].append(part)
                else:
                    groups.append([part])
    pieces: list[SpokenPart] = []
    for piece in (_join(parts) for group in groups for parts in _divide(group)):
        before = pieces[-1] if pieces else None
        if (
            before is not None
            and min(before.duration_s, piece.duration_s) < SHORTEST_S
            and piece.end_s - before.start_s <= LONGEST_S
            and piece.start_s - before.end_s <= LONGEST_PAUSE_S
            and not _is_cut_between(before, piece, cuts_s)
        ):
            pieces[-1] = _join([before, piece])
        else:
            pieces.append(piece)
    wanted = [piece for piece in pieces if piece.duration_s >= LEAST_S]
    return _add_margins(wanted, cuts_s, duration_s, quietest)


def _separate_overlaps(stretches: Sequence[SpokenPart]) -> list[SpokenPart]:
    """Return stretches without overlap: lines of a transcript may be shown together, or a little too long."""
    ordered: list[SpokenPart] = []
    for stretch in sorted(stretches, key=lambda stretch: stretch.start_s):
        if ordered and stretch.start_s < ordered[-1].end_s:
            border_s = max(ordered[-1].start_s, stretch.start_s)
            ordered[-1] = replace(ordered[-1], end_s=border_s)
        ordered.append(stretch)
    return ordered


def _divide_speech(stretch: SpokenPart, quietest: Quietest) -> list[SpokenPart]:
    """Return the parts of a stretch that is too long, divided where it is quietest in its middle third."""
    if stretch.words is not None or stretch.duration_s <= LONGEST_S:
        return [stretch]
    third = stretch.duration_s / 3
    border_s = quietest(stretch.start_s + third, stretch.end_s - third)
    halves = replace(stretch, end_s=border_s), replace(stretch, start_s=border_s)
    return [part for half in halves for part in _divide_speech(half, quietest)]


def _is_cut_between(before: SpokenPart, after: SpokenPart, cuts_s: Sequence[float]) -> bool:
    following = bisect_left(cuts_s, before.end_s - ROUNDING_S)
    return following < len(cuts_s) and cuts_s[following] <= after.start_s + ROUNDING_S


def _join(parts: Sequence[SpokenPart]) -> SpokenPart:
    words = [word for part in parts for word in part.words or ()]
    return SpokenPart(parts[0].start_s, parts[-1].end_s, tuple(words) if parts[0].words is not None else None)


def _divide(group: list[SpokenPart]) -> list[list[SpokenPart]]:
    """Return the parts of a group, none longer than ``LONGEST_S`` unless it is one stretch."""
    if len(group) < 2 or group[-1].end_s - group[0].start_s <= LONGEST_S:
        return [group]
    middle_s = (group[0].start_s + group[-1].end_s) / 2

    def worth(n: int) -> tuple[bool, float]:
        is_long = min(group[n - 1].end_s - group[0].start_s, group[-1].end_s - group[n].start_s) >= SHORTEST_S
        pause_s = group[n].start_s - group[n - 1].end_s
        return is_long, pause_s if is_long else -abs(group[n].start_s - middle_s)

    at = max(range(1, len(group)), key=worth)
    return _divide(group[:at]) + _divide(group[at:])


def _add_margins(
    pieces: list[SpokenPart], cuts_s: Sequence[float], duration_s: float, quietest: Quietest
) -> list[SpokenPart]:
    """Return the pieces with silence at both ends, not beyond a neighbour, a cut or the recording."""
    result: list[SpokenPart] = []
    for n, piece in enumerate(pieces):
        border_s = result[-1].end_s if result else 0.0
        end_s = min(piece.end_s + MARGIN_S, duration_s)
        if n + 1 < len(pieces) and pieces[n + 1].start_s - piece.end_s < 2 * MARGIN_S:
            low_s, high_s = piece.end_s, pieces[n + 1].start_s
            if piece.words is not None:  # lines begin and end late or early
                low_s, high_s = low_s - MARGIN_S / 2, high_s + MARGIN_S / 2
            end_s = quietest(low_s, high_s) if high_s > low_s else low_s
        start_s = max(piece.start_s - MARGIN_S, border_s)
        if result and piece.start_s - pieces[n - 1].end_s < 2 * MARGIN_S:
            start_s = border_s
        middle_s = (piece.start_s + piece.end_s) / 2
        near = [t for t in cuts_s if start_s <= t <= end_s]
        if piece.words is None:
            start_s = max([start_s, *(t for t in near if t <= middle_s)])
            end_s = min([end_s, *(t for t in near if t > middle_s)])
        result.append(replace(piece, start_s=start_s, end_s=end_s))
    return result
