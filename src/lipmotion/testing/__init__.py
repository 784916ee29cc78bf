"""Tools for tests of extensions: checks of the contracts of engines and exporters, and synthetic examples."""

from lipmotion.testing.check_engine import (
    CHANNELS,
    ENGINE_CHECKS,
    PHONES,
    ContractError,
    TrainedEngine,
    check_engine,
    check_exporter,
    example,
    examples,
    speech,
    timeline,
)

__all__ = [
    "CHANNELS", "ENGINE_CHECKS", "PHONES", "ContractError", "TrainedEngine", "check_engine", "check_exporter",
    "example", "examples", "speech", "timeline",
]  # fmt: skip
