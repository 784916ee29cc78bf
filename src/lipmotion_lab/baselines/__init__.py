"""Baselines: methods without a model of phones."""
