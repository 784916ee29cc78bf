"""Labels in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from lipmotion.errors import InputError

LabelT = TypeVar("LabelT")


@dataclass(frozen=True, slots=True)
class Span(Generic[LabelT]):
    """A label that holds from ``start_s`` (included) to ``end_s`` (excluded)."""

    start_s: float
    end_s: float
    label: LabelT

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class Unit:
    """What is spoken in one span: a phone, the model unit it resolved to, and its word.

    phone : empty where a model recognised its own unit, which several phones share: which of them it was is not known
    unit  : between its neighbours (``sil-p+aa``); alone (``bilabial``) where there is no phone
    """

    phone: str
    unit: str = ""
    word: str = ""


@dataclass(frozen=True)
class Timeline(Generic[LabelT]):
    """Spans in order, without overlap; gaps are allowed.

    Raises InputError: a span ends before it starts, or two spans overlap.
    """

    spans: tuple[Span[LabelT], ...]

    def __post_init__(self) -> None:
        end_s = float("-inf")
        for span in self.spans:
            if not span.start_s <= span.end_s:
                raise InputError(f"span {span.label!r} ends at {span.end_s} s, before its start at {span.start_s} s")
            if span.start_s < end_s - 1e-9:
                raise InputError(
                    f"span {span.label!r} starts at {span.start_s} s, before the one ahead of it ends ({end_s} s)"
                )
            end_s = span.end_s

    def __iter__(self) -> Iterator[Span[LabelT]]:
        return iter(self.spans)

    def __len__(self) -> int:
        return len(self.spans)

    def __getitem__(self, position: int) -> Span[LabelT]:
        return self.spans[position]

    def shifted(self, offset_s: float) -> Timeline[LabelT]:
        """Return the same labels, every time moved by ``offset_s`` seconds."""
        return Timeline(tuple(replace(s, start_s=s.start_s + offset_s, end_s=s.end_s + offset_s) for s in self.spans))
