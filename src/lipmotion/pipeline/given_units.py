"""Phones in time that a user gives: from motion files and label files, and without gaps."""

from __future__ import annotations

import math
from pathlib import Path

from lipmotion.corpora.labels import read_phones
from lipmotion.errors import InputError
from lipmotion.export.base import motion_suffixes
from lipmotion.export.base import read_units as read_units_of_motion
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units import SILENCE

LABEL_SUFFIXES = (".textgrid", ".lab", ".txt")
"""Suffixes of label files, in lower case; their content decides which form they have."""


def read_units(path: str | Path) -> Timeline[Unit]:
    """Return the phones in time of a file.

    path : a motion file (``.json``, ``.npz``); a ``.json`` with the member ``units`` alone; or any file of labels that
           corpora may have (``LABEL_SUFFIXES``): a TextGrid with a tier of phones, Audacity's or HTK's labels
    Raises InputError: no such file, not one of these, or without phones.
    """
    path = Path(path)
    if path.suffix.lower() in motion_suffixes():
        return read_units_of_motion(path)
    if path.suffix.lower() in LABEL_SUFFIXES:
        return read_phones(path)
    raise InputError(f"{path}: cannot read phones from {path.suffix!r}; use one of .json, .npz, .TextGrid, .lab, .txt")


def without_gaps(units: Timeline[Unit], duration_s: float) -> Timeline[Unit]:
    """Return phones in time that follow each other from the start to the end of a recording.

    units      : at least one; a last end may be infinite: it becomes the end of the recording
    duration_s : length of the recording in seconds
    A gap is silence. One of less than a frame (10 ms), as rounded times leave, is added to the phone before it instead.
    Units without phones, of unit sets, are returned as they are.
    """
    if not all(span.label.phone for span in units):
        return units
    filled: list[Span[Unit]] = []
    end_s = 0.0
    for span in units:
        _close_gap(filled, end_s, span.start_s)
        end_s = span.end_s if math.isfinite(span.end_s) else max(span.start_s, duration_s)
        filled.append(Span(span.start_s, end_s, span.label))
    if duration_s - end_s >= 1 / FRAME_RATE_HZ:
        _close_gap(filled, end_s, duration_s)
    return Timeline(tuple(filled))


def _close_gap(spans: list[Span[Unit]], start_s: float, end_s: float) -> None:
    """Add silence from the last span to a time, or make the last span longer if that is less than a frame."""
    if end_s - start_s >= 1 / FRAME_RATE_HZ - 1e-9:
        spans.append(Span(start_s, end_s, Unit(SILENCE)))
    elif spans and end_s > start_s:
        spans[-1] = Span(spans[-1].start_s, end_s, spans[-1].label)
