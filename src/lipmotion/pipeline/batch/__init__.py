"""Many recordings at a time: ``batch`` (docs/batch.md)."""

from lipmotion.pipeline.batch.lines import Line, read_lines
from lipmotion.pipeline.batch.run import BatchSummary, batch
from lipmotion.pipeline.batch.settings import BatchSettings

__all__ = ["BatchSettings", "BatchSummary", "Line", "batch", "read_lines"]
