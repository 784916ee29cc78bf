"""Labels in time: spans, units of speech, timelines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

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
            _check_times(span)
            if not span.start_s <= span.end_s:
                raise InputError(f"{_described(span)} ends at {span.end_s} s, before its start at {span.start_s} s")
            if span.start_s < end_s - 1e-9:
                raise InputError(
                    f"{_described(span)} starts at {span.start_s} s, before the previous span ends ({end_s} s); they "
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


def _check_times(span: Span[LabelT]) -> None:
    """Raise InputError if a time is no number, or one that no float can hold."""
    try:
        _ = span.start_s + 0.0 <= span.end_s + 0.0
    except (TypeError, ValueError, OverflowError) as error:
        first, last = (shorten(repr(time_s)) for time_s in (span.start_s, span.end_s))
        raise InputError(f"{_described(span)} lasts from {first} to {last}, required seconds") from error


def _described(span: Span[LabelT]) -> str:
    """Return what a span is, for messages: the phone, the unit, or another label."""
    label = span.label
    if isinstance(label, Unit):
        return f"the phone {label.phone!r}" if label.phone else f"the unit {label.unit!r}"
    return f"the span {label!r}"
