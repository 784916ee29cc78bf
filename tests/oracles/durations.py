"""Chains with explicit durations by enumeration of all segmentations."""

import numpy as np

from oracles.sequences import segmentations


def duration_score(lengths, log_emission, log_duration, log_longer) -> float:
    """Return the log probability of states that last so many frames each."""
    total, frame = 0.0, 0
    for state, length in enumerate(lengths):
        total += log_emission[frame : frame + length, state].sum()
        known = min(length, log_duration.shape[1])
        total += log_duration[state, known - 1] + (length - known) * log_longer[state]
        frame += length
    return total


def best_durations(log_emission, log_duration, log_longer):
    """Return the best lengths and their score (None, -inf: there are none)."""
    ways = segmentations(*log_emission.shape)
    scored = [(duration_score(way, log_emission, log_duration, log_longer), way) for way in ways]
    score, way = max(scored, default=(-np.inf, None))
    return (way, score) if np.isfinite(score) else (None, -np.inf)
