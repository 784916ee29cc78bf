"""Tools for tests of extensions: checks of the contracts of engines and exporters, and synthetic examples."""

from lipmotion.testing.check_engine import ENGINE_CHECKS, ContractError, TrainedEngine, check_engine, check_exporter
from lipmotion.testing.examples import CHANNELS, PHONES, example, examples, speech, timeline

__all__ = [
    "CHANNELS", "ENGINE_CHECKS", "PHONES", "ContractError", "TrainedEngine", "check_engine", "check_exporter",
    "example", "examples", "speech", "timeline",
]  # fmt: skip
