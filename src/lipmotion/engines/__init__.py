"""Speech to motion. Engines never see files or pixels."""

from lipmotion.engines.base import Animator, Engine, Fit
from lipmotion.engines.registry import ENGINES, engine_from_settings, engine_named

__all__ = ["ENGINES", "Animator", "Engine", "Fit", "engine_from_settings", "engine_named"]
