"""Checkpoints: the state of a long job, stored so that a later run continues from it."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from lipmotion.storage.archive import UNREADABLE, read_archive, read_archive_header, write_archive

LOG = logging.getLogger("lipmotion")
FORMAT = "lipmotion.checkpoint"


@dataclass(frozen=True)
class Checkpoint:
    """A folder with one file for each stage of a job; without a folder, nothing is stored and nothing found.

    folder      : an existing one
    fingerprint : of everything that the result depends on; a checkpoint with another fingerprint is not used
    """

    folder: Path | None = None
    fingerprint: str = ""

    def load(self, stage: str) -> dict[str, NDArray[Any]] | None:
        """Return the arrays stored for a stage; None: there are none, or they are damaged or of another job."""
        if self.folder is None or not self._path(self.folder, stage).is_file():
            return None
        path = self._path(self.folder, stage)
        try:
            if read_archive_header(path) != self._header():
                LOG.info("%s: of another corpus, configuration or version; not used", path)
                return None
            return read_archive(path)
        except UNREADABLE as error:
            LOG.info("%s: damaged (%s); not used", path, error)
            return None

    def save(self, stage: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Store the state of a stage, replacing an earlier one. Raises ExportError: it cannot be written."""
        if self.folder is not None:
            write_archive(self._path(self.folder, stage), self._header(), arrays, compressed=False)

    def _header(self) -> dict[str, str]:
        return {"format": FORMAT, "fingerprint": self.fingerprint}

    def _path(self, folder: Path, stage: str) -> Path:
        return folder / f"{stage}.checkpoint"


NO_CHECKPOINT = Checkpoint()
"""Checkpointing disabled: nothing is stored and nothing found."""
