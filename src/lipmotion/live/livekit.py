"""``LipSync`` for agents of LiveKit: the add-on ``lipmotion_agents.livekit``, by the name that users import."""

from lipmotion_agents.livekit import LipSyncOutput as LipSync

__all__ = ["LipSync"]
