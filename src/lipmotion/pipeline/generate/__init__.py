"""Analysed speech, or text, to motion."""
