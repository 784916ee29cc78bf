"""Understood speech, or text, to motion."""
