"""What the checks of all contracts share."""

from __future__ import annotations

from collections.abc import Callable

from lipmotion.errors import LipMotionError


class ContractError(LipMotionError):
    """An extension breaks the contract of its kind."""


def require(holds: bool, found: str) -> None:
    """Raise ContractError, saying what was found, unless something holds."""
    if not holds:
        raise ContractError(found)


def require_error(kind: type[LipMotionError], call: Callable[[], object], what: str) -> None:
    """Raise ContractError unless a call raises an error of one kind."""
    try:
        call()
    except kind:
        return
    except Exception as error:
        raise ContractError(f"{what}: {type(error).__name__} ({error}), required {kind.__name__}") from error
    raise ContractError(f"{what}: no error, required {kind.__name__}")
