"""Mouth shapes of cue files in time: what readers of all formats share."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from statistics import median

from lipmotion.errors import InputError, shortened
from lipmotion.export.cues.cue_shapes import PHONE_SHAPES
from lipmotion.export.cues.sheet import CueSheet
from lipmotion.types import Span, Timeline
from lipmotion.types.values import clock_seconds, number_of
from lipmotion.units.mouth_chart import BLAIR, LETTERS, REST, SHAPES

LOG = logging.getLogger("lipmotion")
_OCULUS = "sil:X PP:A FF:G TH:B DD:B kk:B CH:B SS:B nn:B RR:B aa:D E:C ih:B oh:E ou:F I:B O:E U:F"
_FLEMING_DOBBS = "mbp:A nltdr:B fv:G th:B gk:B sh:F o:E ehsz:C aa:D iy:B rest:X"
FLEMING_DOBBS = dict(pair.split(":") for pair in _FLEMING_DOBBS.split())
PHONES = {"rest": REST, "hh": "C"} | {
    f"{phone}{stress}": parts[0].best[0] for phone, parts in PHONE_SHAPES.items() for stress in ("", 0, 1, 2)
}
"""Shapes by the names of other sets, for which Moho and Papagayo have switches."""
OCULUS = {name.lower(): shape for name, _, shape in (pair.partition(":") for pair in _OCULUS.split())}
"""Shapes by the names of Meta's 15 visemes (``viseme_PP``), old and new."""
PREFIX = "viseme_"
LONGEST_S = 86_400.0
MOST_CUES = 250_000
MILLISECONDS = 20.0
"""Shapes other than rest of which half seem to last so many whole seconds are in milliseconds."""


def shape_of(name: str, names: dict[str, str], place: str) -> str:
    """Return the shape of a name. Raises InputError: it is none, with its place."""
    found = names.get(name.strip().lower().removeprefix(PREFIX))
    if found is None:
        known = " ".join(dict.fromkeys(names))
        raise InputError(f"{place}: no mouth shape is {shortened(name)!r}; the shapes are: {known}")
    return found


def chart_of(names: Iterable[str], usual: dict[str, str] = BLAIR) -> dict[str, str]:
    """Return the shapes by the names of one set that programs offer: the first that has all of them.

    The usual one, Preston Blair's, Rhubarb's letters, Fleming and Dobbs', Meta's visemes, or the phones of CMU's
    dictionary, with stress or without.
    """
    given = {name.strip().lower().removeprefix(PREFIX) for name in names}
    return next((chart for chart in (usual, BLAIR, LETTERS, FLEMING_DOBBS, OCULUS, PHONES) if given <= {*chart}), usual)


def cue_time(text: str, place: str) -> float:
    """Return a time in seconds, as 1.5, 1,5 or 0:01.5, or a number of frames.

    Raises InputError: it is none, with its place.
    """
    value = clock_seconds(text)
    if math.isnan(value):
        value = number_of(text.replace(",", "."), f"{place}: the time is", "a number from 0 on")
    if not 0 <= value <= LONGEST_S * 1000:
        raise InputError(f"{place}: the time is {value:g}, required a number from 0 to {LONGEST_S * 1000:g}")
    return value


def sheet_of(
    rows: Sequence[tuple[float, str]], end_s: float, fps: float, words: Timeline[str] | None = None
) -> CueSheet:
    """Return a sheet of shapes that each last to the next one, with rest before the first.

    rows  : starts in seconds, in order, and shapes;  end_s : of the last one
    Times that are milliseconds are read as these, with a warning.
    Raises InputError: there are none, or too many, or they are not in order.
    """
    if not rows:
        raise InputError("there is no mouth shape in it; export the cues again")
    lengths = [after[0] - row[0] for row, after in pairwise(rows) if row[1] != REST]
    if lengths and median(lengths) >= MILLISECONDS and all(float(start_s).is_integer() for start_s, _ in rows):
        LOG.warning("a mouth shape seems to last %g s: the times are taken for milliseconds", median(lengths))
        rows, end_s = [(start_s / 1000, shape) for start_s, shape in rows], end_s / 1000
    if len(rows) > MOST_CUES or end_s > LONGEST_S:
        raise InputError(f"{len(rows)} mouth shapes in {end_s:g} s, required at most {MOST_CUES} in {LONGEST_S:g} s")
    late = next((place for place, (row, after) in enumerate(pairwise(rows), 1) if after[0] < row[0]), None)
    if late is not None:
        raise InputError(
            f"mouth shape {late + 1} begins at {rows[late][0]:.6g} s, before the one ahead of it at "
            f"{rows[late - 1][0]:.6g} s, required in order of time; export the cues again"
        )
    whole = [(0.0, REST), *rows] if rows[0][0] > 0 else list(rows)
    ends = [*(start_s for start_s, _ in whole[1:]), max(end_s, whole[-1][0])]
    spans = (Span(start_s, stop_s, shape) for (start_s, shape), stop_s in zip(whole, ends, strict=True))
    kept = Timeline(tuple(span for span in spans if span.end_s != span.start_s))
    if not len(kept):
        raise InputError("its mouth shapes last no time; export the cues again")
    return CueSheet(kept, fps, "".join(SHAPES), words or Timeline(()))
