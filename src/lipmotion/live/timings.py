"""Words and phones that are known before they are heard: a text-to-speech service sends them with their times."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.live.network import STEP_S
from lipmotion.meshes.fitting.shape_weights import viseme_curves
from lipmotion.meshes.model.shape_names import VISEMES_15
from lipmotion.motion.articulation import GAIN, trace_articulators
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units import PHONES, SILENCE, VOWELS, describe_unknown_phone
from lipmotion.units.lexicon import Lexicon
from lipmotion.units.text_normalisation import find_words

VOWEL_SHARE = 1.6  # in a word whose phones have no times, a vowel is so many times as long as a consonant
BEFORE_S, REMEMBERED_S = 0.2, 1.0
"""Silence before the first word that is known to be silence; and how long phones are kept once they are said."""
LONGEST_S, LONGEST_GAP_S = 60.0, 600.0
"""A word or a phone that lasts longer, or is so far ahead, has its times in another unit."""


class TimedPhones:
    """The phones that are given so far, and what they make of the mouth in every step."""

    def __init__(self) -> None:
        self._spans: list[Span[Unit]] = []
        self._rows: dict[int, NDArray[np.float64]] = {}

    def add(self, timings: Iterable[tuple[str, float, float]], *, phones: bool, lexicon: Lexicon, now_s: float) -> None:
        """Take words or phones with their times, in seconds of the stream, in order; ``now_s`` is what is known next.

        Raises InputError: times that overlap, end before they begin or are no seconds; an unknown phone.
        """
        spans = [span for span in self._spans if span.end_s > now_s - REMEMBERED_S]
        end_s = spans[-1].end_s if spans else -np.inf
        for timing in timings:
            try:
                label, begin_s, stop_s = (str(timing[0]), *map(float, timing[1:]))
            except (TypeError, ValueError, LookupError, OverflowError) as error:
                required = f"required a text with its start and end, seconds ({error})"
                raise InputError(f"{shorten(repr(timing))}, {required}") from error
            ahead_s = begin_s - max(end_s, now_s)
            if not (ahead_s < LONGEST_GAP_S and end_s - 1e-6 <= begin_s < stop_s < begin_s + LONGEST_S):
                required = f"from {max(end_s, 0):.3f} or up to {LONGEST_GAP_S:g} s on, for less than {LONGEST_S:g} s"
                raise InputError(f"{shorten(label)!r} from {begin_s} to {stop_s}, required seconds {required}")
            start_s = max(begin_s, end_s)
            before_s = start_s - BEFORE_S if end_s < now_s - REMEMBERED_S else end_s
            if start_s - before_s > STEP_S / 2:
                spans.append(Span(before_s, start_s, Unit(SILENCE)))
            spans += _list_phones(label, start_s, stop_s, lexicon=None if phones else lexicon)
            end_s = stop_s
        self._spans = spans
        self._rows = {number: row for number, row in self._rows.items() if number * STEP_S >= now_s - STEP_S}
        if spans:
            self._rows |= _trace(spans, now_s)

    def row(self, number: int) -> NDArray[np.float64] | None:
        """Return articulators and visemes of a step [shape=(23,)]; None: its phones are not known."""
        return self._rows.pop(number, None)


def _list_phones(label: str, start_s: float, stop_s: float, lexicon: Lexicon | None) -> list[Span[Unit]]:
    """Return the phones of a word, or the one phone, within its time; nothing of what is no word."""
    if lexicon is None:
        phone = label.lower().rstrip("012") or SILENCE
        if phone not in PHONES:
            raise InputError(describe_unknown_phone(label))
        return [Span(start_s, stop_s, Unit(phone))]
    phones = [phone for word in find_words(label) for phone in lexicon.pronunciations(word)[0]]
    if not phones:
        return [Span(start_s, stop_s, Unit(SILENCE))]
    lengths = np.array([VOWEL_SHARE if phone in VOWELS else 1.0 for phone in phones])
    edges = start_s + (stop_s - start_s) * np.concatenate([[0.0], np.cumsum(lengths / lengths.sum())])
    return [Span(a, b, Unit(phone, word=label)) for a, b, phone in zip(edges, edges[1:], phones, strict=False)]


def _trace(spans: list[Span[Unit]], now_s: float) -> dict[int, NDArray[np.float64]]:
    """Return articulators and visemes of every step from ``now_s`` to the end of the phones, by its number."""
    origin_s = spans[0].start_s
    units = Timeline(tuple(Span(span.start_s - origin_s, span.end_s - origin_s, span.label) for span in spans))
    first, stop = int(np.ceil(max(origin_s, now_s) / STEP_S - 1e-9)), int(np.ceil(spans[-1].end_s / STEP_S - 1e-9))
    time_s: NDArray[np.float64] = np.arange(first, stop, dtype=float) * STEP_S - origin_s
    frames = max(int(np.ceil((spans[-1].end_s - origin_s) * FRAME_RATE_HZ)), 1)
    known_s = np.arange(frames) / FRAME_RATE_HZ
    articulators = [np.interp(time_s, known_s, column) for column in GAIN * trace_articulators(units, frames).T]
    curves = viseme_curves(units, time_s)
    rows = np.stack([*articulators, *(curves[name] for name in VISEMES_15)], axis=1)
    return dict(zip(range(first, stop), rows, strict=True))
