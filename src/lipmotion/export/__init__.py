"""Motion and pictures → files that other programs open: one file per format."""

from lipmotion.export.base import MOTION_SUFFIXES, read_motion, write_motion
from lipmotion.export.video import write_mp4

__all__ = ["MOTION_SUFFIXES", "read_motion", "write_motion", "write_mp4"]
