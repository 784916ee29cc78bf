"""Acoustic features of a recording."""
