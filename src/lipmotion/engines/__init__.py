"""Speech to motion. Engines never see files or pixels."""

from lipmotion.engines.base import Engine, Fit
from lipmotion.engines.registry import ENGINES, engine_as_told, engine_named

__all__ = ["ENGINES", "Engine", "Fit", "engine_as_told", "engine_named"]
