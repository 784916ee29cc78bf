"""Motion and cues in files that other programs open: one flat file a format, chosen by the suffix (``base``)."""

from lipmotion.formats.base import (
    MotionFormat,
    find_suffix,
    list_read_suffixes,
    list_suffixes,
    read_motion,
    write_motion,
)

__all__ = ["MotionFormat", "find_suffix", "list_read_suffixes", "list_suffixes", "read_motion", "write_motion"]
