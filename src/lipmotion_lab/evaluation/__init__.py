"""Evaluation: a model and held-out recordings to figures."""
