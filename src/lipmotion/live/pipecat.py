"""``LipSync`` for pipelines of Pipecat: the add-on ``lipmotion_agents.pipecat``, by the name that users import."""

from lipmotion_agents.pipecat import LipSyncProcessor as LipSync

__all__ = ["LipSync"]
