"""What of a face is learned: how points move, what the mouth looks like, or both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.eigenlips import COMPONENTS, Eigenlips, fit_eigenlips
from lipmotion.errors import CorpusError, InputError
from lipmotion.stats.pca import evenly_spaced
from lipmotion.types import Motion, Track, Utterance

GEOMETRY, EIGENLIPS, BOTH = "geometry", "eigenlips", "both"
VISUALS = (GEOMETRY, EIGENLIPS, BOTH)
"""The channels that were tracked or given; the coefficients of mouth pictures; these after those."""
PICTURES = 980
"""Frames that eigenlips are learned from. Source: Xie & Liu 2007, §5."""


def check_visual(visual: str) -> None:
    """Raise InputError unless it is one of ``VISUALS``."""
    if visual not in VISUALS:
        raise InputError(f"visual is {visual!r}, required one of: {', '.join(VISUALS)}")


def train_eigenlips(
    utterances: Sequence[Utterance], components: int = COMPONENTS, pictures: int = PICTURES
) -> Eigenlips:
    """Return the eigenlips of some utterances, from frames that are seen, spread evenly over all of them.

    Raises CorpusError: an utterance without mouth pictures, or none with a frame that is seen.
    """
    seen = [np.flatnonzero(utterance.track.seen) for utterance in utterances]
    ends = np.cumsum([len(frames) for frames in seen])
    chosen = evenly_spaced(pictures, int(ends[-1]) if len(ends) else 0)
    if not len(chosen):
        raise CorpusError(f"no face is seen in {len(utterances)} utterances; prepare a corpus of videos with faces")
    parts = np.split(chosen, np.searchsorted(chosen, ends[:-1]))
    taken = [
        _crops(utterance)[frames[part - (end - len(frames))]]
        for utterance, frames, part, end in zip(utterances, seen, parts, ends, strict=True)
    ]
    sizes = {some.shape[1:] for some in taken}
    if len(sizes) > 1:
        raise CorpusError(f"mouth pictures of {len(sizes)} sizes; prepare all recordings again with one lipmotion")
    return fit_eigenlips(np.concatenate(taken), components)


def with_visual_channels(utterance: Utterance, visual: str, eigenlips: Eigenlips | None) -> Utterance:
    """Return an utterance whose motion has the channels that are learned, at the camera's rate.

    eigenlips : of ``train_eigenlips``; the coefficients are not smoothed, and those of unseen frames not meant
    Raises InputError: no such ``visual``, or eigenlips are missing. Raises CorpusError: mouth pictures are missing.
    """
    check_visual(visual)
    if visual == GEOMETRY:
        return utterance
    if eigenlips is None:
        raise InputError(f"visual {visual!r} without eigenlips; required: those of learned_eigenlips, or of the model")
    return replace(
        utterance, track=_with_eigenlips(utterance.track, eigenlips.project(_crops(utterance)), visual, eigenlips)
    )


def _with_eigenlips(track: Track, coefficients: NDArray[np.float32], visual: str, eigenlips: Eigenlips) -> Track:
    values, channels = coefficients.astype(float), eigenlips.channels
    if visual == BOTH:
        values = np.concatenate([track.motion.values, values], axis=1)
        channels = (*track.motion.channels, *channels)
    return replace(track, motion=Motion(values, track.motion.rate_hz, channels))


def _crops(utterance: Utterance) -> NDArray[np.uint8]:
    crops = utterance.track.crops
    if crops is None:
        raise CorpusError(
            f"{utterance.name}: no mouth pictures, which eigenlips need; prepare its video again without --no-crops, "
            "or train with --visual geometry"
        )
    return np.asarray(crops)
