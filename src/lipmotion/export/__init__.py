"""Motion, cues and pictures to files that other programs open: one module per format."""

from lipmotion.export.base import (
    MotionFormat,
    motion_suffix,
    motion_suffixes,
    read_motion,
    readable_suffixes,
    write_motion,
)
from lipmotion.export.video import write_mp4

__all__ = [
    "MotionFormat",
    "motion_suffix",
    "motion_suffixes",
    "read_motion",
    "readable_suffixes",
    "write_motion",
    "write_mp4",
]
