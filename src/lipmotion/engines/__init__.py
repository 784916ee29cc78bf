"""Engines: methods that learn and generate motion from speech. They do not read files."""

from lipmotion.engines.base import Animator, Engine, Fit, Inputs
from lipmotion.engines.registry import ENGINES, engine_from_settings, engine_named, preset_visual

__all__ = ["ENGINES", "Animator", "Engine", "Fit", "Inputs", "engine_from_settings", "engine_named", "preset_visual"]
