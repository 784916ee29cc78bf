"""A model that moves lines, with what tells it from other models."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lipmotion.pipeline.model import Model, load_model, shipped_path
from lipmotion.storage.files import sha256_of

SHORT_DIGEST = 8
"""Figures of a digest that people see."""


@dataclass(frozen=True)
class KnownModel:
    """A model, and what tells it from others.

    name   : of its file, without suffix: what its owner calls it
    digest : of its file (SHA-256)
    """

    model: Model
    name: str
    digest: str

    def name_beside(self, other: KnownModel) -> str:
        """Return its name, with the beginning of its digest where another model has the same name."""
        return self.name if self.name != other.name else f"{self.name} ({self.digest[:SHORT_DIGEST]})"


def known_model(file: Path | None) -> KnownModel:
    """Return the model of a file; None: the one that ships. Raises as ``load_model``."""
    model, path = load_model(file), file or shipped_path()
    return KnownModel(model, path.stem, sha256_of(path))
