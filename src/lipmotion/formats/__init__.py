"""Motion and cues in files that other programs open: one flat file a format, chosen by the suffix (``base``)."""

from lipmotion.formats.base import (
    MotionFormat,
    motion_suffix,
    motion_suffixes,
    read_motion,
    readable_suffixes,
    write_motion,
)

__all__ = ["MotionFormat", "motion_suffix", "motion_suffixes", "read_motion", "readable_suffixes", "write_motion"]
