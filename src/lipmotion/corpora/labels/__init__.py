"""Transcripts and labels of a recording, from text files beside it."""

from lipmotion.corpora.labels.label_files import (
    RecordingLabels,
    check_plain_text,
    holds_timings,
    label_files_beside,
    labels_beside,
    read_labels,
    read_phones,
    read_plain_text,
    read_transcript,
    speakers_in,
)
from lipmotion.corpora.labels.subtitles import is_subtitles, subtitle_words

__all__ = [
    "RecordingLabels",
    "check_plain_text",
    "holds_timings",
    "is_subtitles",
    "label_files_beside",
    "labels_beside",
    "read_labels",
    "read_phones",
    "read_plain_text",
    "read_transcript",
    "speakers_in",
    "subtitle_words",
]
