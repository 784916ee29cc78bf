"""Recordings whose phones and motion are given."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.costs import Costs, SelectionConfig, Target
from lipmotion.engines.selection.inventory import RecordedUnits, list_windows
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import Lexicon

FREE = SelectionConfig(
    context=0, word=0, stress=0, duration=0, guide=0, join=0, velocity=0, hard=0, protected=0, cluster=0
)
"""Nothing costs anything."""
PHONE_S = 0.2


def timeline(text: str, duration_s: float = PHONE_S) -> Timeline[Unit]:
    """Return phones of equal duration; a bar stands between words."""
    spans: list[Span[Unit]] = []
    for number, word in enumerate(text.split("|")):
        for phone in word.split():
            start_s = len(spans) * duration_s
            spans.append(Span(start_s, start_s + duration_s, Unit(phone, word="" if phone == "sil" else f"w{number}")))
    return Timeline(tuple(spans))


def sentence(words: str, duration_s: float = PHONE_S) -> Timeline[Unit]:
    """Return the phones of English words by the dictionary, of equal duration, with their words."""
    spoken = [Unit(phone, word=word) for word in words.split() for phone in Lexicon().pronunciations(word)[0]]
    return Timeline(tuple(Span(n * duration_s, (n + 1) * duration_s, unit) for n, unit in enumerate(spoken)))


def inventory(*texts: str, levels: Sequence[float] = (), duration_s: float = PHONE_S) -> RecordedUnits:
    """Return recordings of phones, without stress; the motion of each stays at its level (0)."""
    units = recorded(*(timeline(text, duration_s) for text in texts), levels=levels)
    return with_stress(units, *[-1] * len(units.windows))


def recorded(*spoken: Timeline[Unit], levels: Sequence[float] = ()) -> RecordedUnits:
    """Return recordings of phones; the motion of each stays at its level (0)."""
    lengths = [round(each[-1].end_s * 100) + 1 for each in spoken]
    first = np.cumsum([0, *lengths])
    drawn = np.concatenate(
        [np.full((n, 1), float(x)) for n, x in zip(lengths, levels or [0.0] * len(spoken), strict=True)]
    )
    windows = list_windows(spoken)
    usable = np.ones(len(windows), bool)
    names = tuple(f"r{number}" for number in range(len(spoken)))
    return RecordedUnits(names, windows, usable, first, np.array([[0, first[-1]]]), drawn, None)


def target_of(costs: Costs, text: str, stress: Sequence[int] | None = None) -> Target:
    """Return phones to be said, without a guide; their stress is not known unless given."""
    windows = list_windows([timeline(text)])
    known = np.full(len(windows), -1) if stress is None else np.array(stress)
    return costs.target(replace(windows, stress=known.astype(np.int8)), None, None)


def costs_of(units: RecordedUnits, config: SelectionConfig = FREE, **options: Any) -> Costs:
    return Costs(units, replace(config, **options), np.ones(units.values.shape[1]))


def array(*numbers: int) -> NDArray[np.intp]:
    return np.array(numbers, np.intp)


def with_stress(units: RecordedUnits, *stress: int) -> RecordedUnits:
    return replace(units, windows=replace(units.windows, stress=np.array(stress, np.int8)))
