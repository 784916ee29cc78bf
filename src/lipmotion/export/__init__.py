"""Motion, cues and pictures to files that other programs open: one module per format."""

from lipmotion.export.base import (
    MotionFormat,
    motion_suffix,
    motion_suffixes,
    read_motion,
    readable_suffixes,
    write_motion,
)

__all__ = [
    "MotionFormat",
    "motion_suffix",
    "motion_suffixes",
    "read_motion",
    "readable_suffixes",
    "write_motion",
]
