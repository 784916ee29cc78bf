"""How training reports what it does."""

from __future__ import annotations

from collections.abc import Callable

Monitor = Callable[[str, float], None]
"""Called with the name of a step and a figure of it (a mean log likelihood per frame, a count)."""


def silent_monitor(step: str, value: float) -> None:
    """Report nothing."""
