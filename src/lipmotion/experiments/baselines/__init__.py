"""Baselines: methods that need no model of phones."""
