"""Many recordings at a time: ``batch`` (docs/batch.md)."""

from lipmotion.pipeline.batch.lines import BatchLine, read_lines
from lipmotion.pipeline.batch.run import BatchSummary, batch
from lipmotion.pipeline.batch.settings import BatchSettings

__all__ = ["BatchLine", "BatchSettings", "BatchSummary", "batch", "read_lines"]
