"""Tools for tests of extensions: checks of the contracts of engines and exporters, and synthetic examples."""

from lipmotion.testing.check_engine import ENGINE_CHECKS, ContractError, TrainedEngine, check_engine, check_exporter

__all__ = ["ENGINE_CHECKS", "ContractError", "TrainedEngine", "check_engine", "check_exporter"]
