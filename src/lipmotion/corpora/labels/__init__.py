"""Transcripts and labels of a recording, from text files beside it."""

from lipmotion.corpora.labels.label_files import (
    RecordingLabels,
    holds_timings,
    label_files_beside,
    labels_beside,
    read_labels,
    read_phones,
    read_transcript,
    speakers_in,
)
from lipmotion.corpora.labels.plain_text import check_plain_text

__all__ = [
    "RecordingLabels",
    "check_plain_text",
    "holds_timings",
    "label_files_beside",
    "labels_beside",
    "read_labels",
    "read_phones",
    "read_transcript",
    "speakers_in",
]
