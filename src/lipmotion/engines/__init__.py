"""Engines: methods that learn and generate motion from speech. They do not read files."""

from lipmotion.engines.base import Animator, Engine, Fit, Inputs
from lipmotion.engines.registry import ENGINES, create_engine, engine_named, find_visual

__all__ = ["ENGINES", "Animator", "Engine", "Fit", "Inputs", "create_engine", "engine_named", "find_visual"]
