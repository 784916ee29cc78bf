"""Whether what should have been said is what is heard."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.general.acoustic import STATES, density_column, general_model
from lipmotion.speech.general.front_end import general_features
from lipmotion.types import FRAME_RATE_HZ, Audio, Timeline, Unit
from lipmotion.units import is_silent

DOUBTFUL_SCORE = -4.2
"""Under this, the words are probably others: right ones reach -1 to -4, wrong ones -2 to -9 (docs/robustness.md)."""
FRAME_STEP = 4
"""Every fourth frame is heard: its neighbours say the same."""


def agreement_score(audio: Audio, units: Timeline[Unit]) -> float:
    """Return how well the sound goes with phones in time, to the ears of the general models.

    units : of the audio, as ``Recogniser.align`` gives them
    Returns the mean log density of each frame's phone, over frames of speech, the best of all phones taken off: 0 where
    no other would fit better, or nothing is spoken.
    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    frames, states = (part[::FRAME_STEP] for part in _spoken(units))
    if not len(frames):
        return 0.0
    density = general_model().log_density(general_features(audio)[frames])
    said = np.take_along_axis(density, states[:, None] + np.arange(STATES), axis=1)
    return float(said.max(axis=1).mean())


def _spoken(units: Timeline[Unit]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the frames of speech, and the density of the first state of the phone in each."""
    frames, states = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
    for span in units:
        if not is_silent(span.label.phone):
            first, stop = (int(np.ceil(time_s * FRAME_RATE_HZ - 1e-6)) for time_s in (span.start_s, span.end_s))
            frames.append(np.arange(first, stop))
            states.append(np.full(stop - first, density_column(span.label.phone, 0, STATES)))
    return np.concatenate(frames), np.concatenate(states)
