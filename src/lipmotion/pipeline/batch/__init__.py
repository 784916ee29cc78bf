"""Many recordings at a time: ``batch`` (docs/batch.md)."""

from lipmotion.pipeline.batch.check import CheckSummary, check
from lipmotion.pipeline.batch.lines import BatchLine, read_lines
from lipmotion.pipeline.batch.run import BatchSummary, batch

__all__ = ["BatchLine", "BatchSummary", "CheckSummary", "batch", "check", "read_lines"]
