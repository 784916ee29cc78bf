"""Plug-ins for voice agents: lip motion in Pipecat's pipelines and around LiveKit's outputs."""
