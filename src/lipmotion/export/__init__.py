"""Videos, pages and marks of synthetic pictures."""

from lipmotion.export.video import write_mp4

__all__ = ["write_mp4"]
