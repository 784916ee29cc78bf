"""Tools for tests and extensions of lipmotion: checks of the contracts, synthetic examples, the toy corpus."""

from lipmotion.testing.check_engine import ENGINE_CHECKS, ContractError, TrainedEngine, check_engine, check_exporter
from lipmotion.testing.toy import toy_motion, toy_sentences, toy_utterances

__all__ = [
    "ENGINE_CHECKS", "ContractError", "TrainedEngine", "check_engine", "check_exporter", "toy_motion",
    "toy_sentences", "toy_utterances",
]  # fmt: skip
