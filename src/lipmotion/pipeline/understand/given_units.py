"""Phones in time that a user gives: from motion files and label files."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.labels import holds_timings, read_phones
from lipmotion.errors import InputError
from lipmotion.formats.base import motion_suffix
from lipmotion.formats.base import read_units as read_units_of_motion
from lipmotion.storage.sources import check_kind
from lipmotion.types import Timeline, Unit

LABEL_SUFFIXES = (".textgrid", ".eaf", ".lab", ".phn", ".txt", ".json", ".jsonl", ".marks", ".csv", ".tsv")
"""Suffixes of label files, in lower case; their content decides which form they have. ``.json`` and ``.csv`` may also
be motion."""


def read_units(path: str | Path, tier: str = "", speaker: str = "") -> Timeline[Unit]:
    """Return the phones in time of a file.

    path : a motion file (``.json``, ``.npz``); a ``.json`` with the member ``units`` alone; or any file of labels that
           corpora may have (``LABEL_SUFFIXES``): a TextGrid with a tier of phones, Audacity's or HTK's labels, the
           timings of a voice or an aligner
    tier, speaker : of labels, which tier and whose phones (``read_phones``)
    Raises InputError: no such file, not one of these, or without phones.
    """
    path = Path(path)
    check_kind(path, "motion file", "units file")
    is_label = path.suffix.lower() in LABEL_SUFFIXES
    if motion_suffix(path) and not (is_label and holds_timings(path)):
        return read_units_of_motion(path)
    if is_label:
        return read_phones(path, tier, speaker)
    required = "use one of .json, .npz, .TextGrid, .eaf, .lab, .txt, .jsonl, .marks"
    raise InputError(f"{path}: cannot read phones from {path.suffix!r}; {required}")
