"""Labels in time: spans, units of speech, timelines; and how sure motion is, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten

LabelT = TypeVar("LabelT")


@dataclass(frozen=True, slots=True)
class Span(Generic[LabelT]):
    """A label that applies from ``start_s`` (included) to ``end_s`` (excluded).

    start_s, end_s : seconds
    label          : in a generation, a ``Unit``

    >>> Span(0.25, 0.75, Unit("aa")).duration_s
    0.5
    """

    start_s: float
    end_s: float
    label: LabelT

    @property
    def duration_s(self) -> float:
        """Duration in seconds."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class Unit:
    """The phone of one span, the unit of the model that represents it, and its word.

    phone : one of the 47 phones of the inventory; empty where a model recognised a unit that several phones share
    unit  : full-context name of the unit (``sil-p+aa``), or its name alone (``bilabial``) where there is no phone
    word  : the word that contains the phone; empty where it is not known
    confidence : of a recognised phone, 0 to 1: how well words confirm it; None: the phone is known (given, labelled, or
                 aligned to known words)
    again : whether the phone begins its word anew, right after the same word

    >>> Unit("p", "sil-p+l", "please")
    Unit(phone='p', unit='sil-p+l', word='please')
    """

    phone: str
    unit: str = ""
    word: str = ""
    confidence: float | None = field(default=None, repr=False)
    again: bool = field(default=False, repr=False, compare=False)


@dataclass(frozen=True)
class Timeline(Generic[LabelT]):
    """Spans in order of time, without overlap; gaps are allowed.

    Raises InputError: a time is no number, a span ends before it starts, or two spans overlap.

    >>> timeline = Timeline((Span(0.0, 0.5, Unit("sil")), Span(0.5, 0.6, Unit("p"))))
    >>> len(timeline), timeline[1].label.phone, timeline.shifted(1.0)[1].start_s
    (2, 'p', 1.5)
    """

    spans: tuple[Span[LabelT], ...]

    def __post_init__(self) -> None:
        end_s = float("-inf")
        for span in self.spans:
            try:
                _ = span.start_s + 0.0 <= span.end_s + 0.0  # numbers, and such as a float can hold
            except (TypeError, ValueError, OverflowError) as error:
                first, last = (shorten(repr(time_s)) for time_s in (span.start_s, span.end_s))
                raise InputError(f"{_describe(span)} lasts from {first} to {last}, required seconds") from error
            if not span.start_s <= span.end_s:
                raise InputError(f"{_describe(span)} ends at {span.end_s} s, before its start at {span.start_s} s")
            if span.start_s < end_s - 1e-9:
                raise InputError(
                    f"{_describe(span)} starts at {span.start_s} s, before the previous span ends ({end_s} s); they "
                    "must not overlap: correct one of the times"
                )
            end_s = span.end_s

    def __iter__(self) -> Iterator[Span[LabelT]]:
        return iter(self.spans)

    def __len__(self) -> int:
        return len(self.spans)

    def __getitem__(self, position: int) -> Span[LabelT]:
        return self.spans[position]

    def between(self, start_s: float, end_s: float) -> Timeline[LabelT]:
        """Return what lies in a stretch, cut at its ends, with times from its start."""
        return Timeline(
            tuple(
                Span(max(span.start_s, start_s) - start_s, min(span.end_s, end_s) - start_s, span.label)
                for span in self.spans
                if span.end_s > start_s and span.start_s < end_s
            )
        )

    def shifted(self, offset_s: float) -> Timeline[LabelT]:
        """Return the timeline with ``offset_s`` seconds added to all times."""
        return Timeline(tuple(replace(s, start_s=s.start_s + offset_s, end_s=s.end_s + offset_s) for s in self.spans))


def _describe(span: Span[LabelT]) -> str:
    label = span.label
    if isinstance(label, Unit):
        return f"the phone {label.phone!r}" if label.phone else f"the unit {label.unit!r}"
    return f"the span {label!r}"


Curve = NDArray[np.float64]
VARIANCE_FACTOR = 8.0
"""Squared error of a voice that training knows, for each unit of the model's own variance: its frames count as
independent of one another, and are not."""
UNFAMILIAR, UNFAMILIAR_MOVEMENT, UNFAMILIAR_DOUBT = 0.45, 0.75, 0.15
"""Squared error, in the variance of the curve, of a voice that training does not know at all: in every frame, for each
unit of squared distance from the mean, and where no phone is sure."""
OTHER_WORDS = 0.5
"""Squared error that a transcript of something else adds: 0.5 on average of eight unseen speakers, 0.2 of seen ones."""
MIN_DEVIATION = 0.02  # a curve that moves less, in eye distances or as a weight, counts as moving so far


@dataclass(frozen=True)
class SpeechKnowledge:
    """How well a model knows what is said and who speaks.

    voice  : 0 to 1, how well training knows the voice (``Speech.voice``)
    phones : 0 to 1, how sure the phones are (``Speech.confidence``), on average; 1 where they are known
    fit    : 0 to 1, how far the transcript or given phones fit, in all or in each frame; 1 where there are none
    """

    voice: float
    phones: float
    fit: float | Curve = 1.0

    def confidence(self, curve: NDArray[np.floating], variance: NDArray[np.floating]) -> Curve:
        """Return how sure each frame of a curve is, 0 to 1 [shape=(T,)]: 1 / (1 + expected squared error).

        curve, variance : values and variances by the model [each shape=(T,)]
        The expected squared error is in units of the variance of the curve, so that 0.5 means an error as large as the
        movement. Its causes are the model's own variance and, as far as the voice is unknown: 1, the squared distance
        of the curve from its mean, and how unsure the phones are. Their weights were measured on recordings whose
        motion is known (docs/results/voices.md).
        """
        values = np.asarray(curve, float)
        unit = max(float(values.var()), MIN_DEVIATION**2)
        distance, one = np.square(values - values.mean()) / unit, np.ones(len(values))
        unfamiliar = (1 - self.voice) * np.stack([one, distance, (1 - self.phones) * one])
        causes = np.concatenate([np.maximum(variance, 0)[None] / unit, unfamiliar])
        weights = (VARIANCE_FACTOR, UNFAMILIAR, UNFAMILIAR_MOVEMENT, UNFAMILIAR_DOUBT)
        fit = np.atleast_1d(self.fit)[np.linspace(0, np.size(self.fit) - 1, len(curve)).round().astype(int)]
        return 1 / (1 + weights @ causes + OTHER_WORDS * (1 - fit))
