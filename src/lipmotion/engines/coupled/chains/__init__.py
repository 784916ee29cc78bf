"""Coupled chains of hidden states: structures, transitions, emission densities, inference."""
