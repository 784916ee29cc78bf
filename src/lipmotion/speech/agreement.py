"""The agreement score: whether a transcript is what is said in a recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.analysed_audio import analysed
from lipmotion.speech.general.acoustic import STATES, density_column, general_model
from lipmotion.types import FRAME_RATE_HZ, Audio, Timeline, Unit
from lipmotion.units import is_silent

DOUBTFUL_SCORE = -4.2
"""Under this score the transcript is probably wrong: right ones score -1 to -4, wrong ones -2 to -9
(docs/robustness.md)."""
FRAME_STEP = 4
"""Only every fourth frame is scored: its neighbours are much like it."""


def agreement_score(audio: Audio, units: Timeline[Unit]) -> float:
    """Return how well a recording agrees with phones in time, by the general models.

    audio : an ``AnalysedAudio`` shares its features with what else is computed of it
    units : of the audio, as ``Recogniser.align`` returns them
    Returns the mean, over frames of speech, of the log density of the frame's phone less that of the best phone: 0
    where no other phone is more probable, or nothing is spoken.
    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    frames, states = (rows[::FRAME_STEP] for rows in _spoken_frames(units))
    if not len(frames):
        return 0.0
    log_densities = general_model().log_density(analysed(audio).general_features[frames])
    of_phone = np.take_along_axis(log_densities, states[:, None] + np.arange(STATES), axis=1)
    return float(of_phone.max(axis=1).mean())


def _spoken_frames(units: Timeline[Unit]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the frames of speech, and in each the general density of its phone's first state [shapes=(S,), (S,)]."""
    frames, states = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
    for span in units:
        if not is_silent(span.label.phone):
            first, stop = (int(np.ceil(time_s * FRAME_RATE_HZ - 1e-6)) for time_s in (span.start_s, span.end_s))
            frames.append(np.arange(first, stop))
            states.append(np.full(stop - first, density_column(span.label.phone, 0, STATES)))
    return np.concatenate(frames), np.concatenate(states)
