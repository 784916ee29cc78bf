"""How far engines disagree about the opening of the mouth, second by second, and whether that tells their error.

Everything is in units of one deviation: that of the opening in the recordings that are compared.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from lipmotion.measures.bootstrap import bootstrap_interval
from lipmotion.measures.curves import correlation
from lipmotion.pipeline.evaluation.held_out import ComparedClip

Array = NDArray[np.float64]
LEAST_FRAMES = 5
"""A second with fewer measured frames has no figures."""
ROUNDING_S = 1e-6
ERROR_SHARE = 2.0
"""Error for one unit of disagreement that a confidence supposes."""
QUARTERS = 4
SPOKEN_SHARE = 0.5
"""A second counts as speech from this share of it on."""


@dataclass(frozen=True, eq=False)
class OpeningOfClip:
    """The opening in one recording: as recorded, and as several systems generate it; N measured frames.

    time_s    : time of every frame in seconds [shape=(N,)]
    original  : in units of the recordings' deviation [shape=(N,)]
    generated : by each system, in the same unit [each shape=(N,)]
    spoken    : whether a phone of speech is said in the frame [shape=(N,)]
    """

    time_s: Array
    original: Array
    generated: Mapping[str, Array]
    spoken: NDArray[np.bool_]

    def disagreement(self, systems: Sequence[str]) -> Array:
        """Return the standard deviation between systems in every second [shape=(S,)].

        It is the root of the mean over frames of the variance between the systems' openings; NaN in seconds in which
        hardly any frame was measured.
        """
        return self._per_second(np.var([self.generated[name] for name in systems], axis=0))

    def error(self, system: str) -> Array:
        """Return the root of the mean squared error of a system in every second [shape=(S,)]; NaN as above."""
        return self._per_second(np.square(self.generated[system] - self.original))

    def movement(self, system: str) -> Array:
        """Return the standard deviation of what a system generates within every second [shape=(S,)]; NaN as above."""
        curve = self.generated[system]
        squares = self._per_second(np.square(curve)) ** 2 - self._per_second(curve, root=False) ** 2
        return np.sqrt(np.maximum(squares, 0))

    def speech(self) -> Array:
        """Return the share of speech in every second, 0 to 1 [shape=(S,)]; NaN as above."""
        return self._per_second(self.spoken.astype(float), root=False)

    def _per_second(self, values: Array, *, root: bool = True) -> Array:
        """Return the (root of the) mean of values [shape=(N,)] in every second [shape=(S,)]."""
        second = np.floor(self.time_s + ROUNDING_S).astype(np.intp)
        frames = np.bincount(second)
        means = np.bincount(second, values) / np.maximum(frames, 1)
        return np.where(frames >= LEAST_FRAMES, np.sqrt(means) if root else means, np.nan)


def openings_of_clips(clips: Mapping[str, Sequence[ComparedClip]], column: int) -> tuple[list[OpeningOfClip], float]:
    """Return the openings of all recordings, and the deviation that is their unit, in eye distances.

    clips  : of each system, the same recordings in the same order
    column : of the opening among the compared channels
    """
    first = next(iter(clips.values()))
    deviation = float(np.concatenate([clip.original[:, column] for clip in first]).std())
    unit = deviation or 1.0
    openings = [
        OpeningOfClip(
            clip.time_s,
            clip.original[:, column] / unit,
            {name: made[number].generated[:, column] / unit for name, made in clips.items()},
            _spoken_frames(clip),
        )
        for number, clip in enumerate(first)
    ]
    return openings, deviation


def _spoken_frames(clip: ComparedClip) -> NDArray[np.bool_]:
    spoken = np.zeros(len(clip.time_s), bool)
    for start_s, end_s, _ in clip.spoken:
        spoken |= (clip.time_s >= start_s) & (clip.time_s < end_s)
    return spoken


def confidence_of(disagreement: Array) -> Array:
    """Return a confidence from 0 to 1 [same shape]: 1 - 2 · disagreement, but at least 0; NaN stays.

    So 1 means that the engines agree, and 0 that they are half a deviation of the recorded opening apart or more. On
    the list ``val`` of the speaker GRID s1 the error was two to three times the disagreement where the mouth moves
    (docs/results/engines.md): the confidence is about 1 minus the error that is to be expected.
    """
    return np.clip(1 - ERROR_SHARE * disagreement, 0, 1)


def rank_correlation(some: Sequence[Array], others: Sequence[Array]) -> float:
    """Return Spearman's rank correlation of two figures over the seconds of all clips; 0 where one is constant.

    some, others : of each clip [each shape=(S,)], without NaN
    """
    ranks = [rankdata(np.concatenate(side))[:, None] for side in (some, others)]
    return float(correlation(*ranks)[0])


def partial_rank_correlation(some: Sequence[Array], others: Sequence[Array], given: Sequence[Array]) -> float:
    """Return the rank correlation of two figures where a third one is held constant.

    Source: the first-order partial correlation of Kendall 1942, of ranks.
    """
    both, some_given, others_given = (
        rank_correlation(*pair) for pair in ((some, others), (some, given), (others, given))
    )
    scale = np.sqrt((1 - some_given**2) * (1 - others_given**2))
    return float((both - some_given * others_given) / scale) if scale > ROUNDING_S else 0.0


def disagreement_figures(
    openings: Sequence[OpeningOfClip], engines: Sequence[str], mean: str, names: Sequence[str], seed: int
) -> dict[str, Any]:
    """Return disagreement and confidence of every second of every clip, and how well they rank the seconds by error.

    openings : of all clips
    engines  : the systems between which the disagreement is computed
    mean     : name of the system that is the mean of these
    names    : of the clips
    seed     : of the bootstrap intervals over clips
    ``rank_correlation`` has, for each system, Spearman's correlation of disagreement and error over all seconds,
    ``in_speech`` that over the seconds of which at least half is speech: in silence all engines agree and are right,
    so that the former would be high even if disagreement told no more than whether somebody speaks.
    ``movement``, for comparison, is that of the error of the mean with how much the mean moves in this second, and
    ``beyond_movement`` the partial one of disagreement and error at equal movement. ``quarters`` has the error of the
    mean in the quarters of the seconds, from the least disagreement to the greatest.
    """
    known = [~np.isnan(clip.disagreement(engines)) for clip in openings]
    spoken = [clip.speech()[kept] >= SPOKEN_SHARE for clip, kept in zip(openings, known, strict=True)]
    differing = [clip.disagreement(engines)[kept] for clip, kept in zip(openings, known, strict=True)]
    errors = {
        name: [clip.error(name)[kept] for clip, kept in zip(openings, known, strict=True)]
        for name in openings[0].generated
    }
    moving = [clip.movement(mean)[kept] for clip, kept in zip(openings, known, strict=True)]
    clips = {}
    for name, clip in zip(names, openings, strict=True):
        differs = clip.disagreement(engines)
        clips[name] = {
            "disagreement": differs.tolist(),
            "confidence": confidence_of(differs).tolist(),
            "error": {system: clip.error(system).tolist() for system in clip.generated},
        }
    return {
        "seconds": int(sum(map(len, differing))),
        "rank_correlation": {name: _with_interval(differing, error, seed) for name, error in errors.items()},
        "seconds_of_speech": int(sum(map(np.count_nonzero, spoken))),
        "in_speech": {
            name: _with_interval(_chosen(differing, spoken), _chosen(error, spoken), seed)
            for name, error in errors.items()
        },
        "movement": _with_interval(moving, errors[mean], seed),
        "beyond_movement": partial_rank_correlation(differing, errors[mean], moving),
        "quarters": _quarters(np.concatenate(differing), np.concatenate(errors[mean])),
        "clips": clips,
    }


def _chosen(values: Sequence[Array], chosen: Sequence[NDArray[np.bool_]]) -> list[Array]:
    return [x[kept] for x, kept in zip(values, chosen, strict=True)]


def _with_interval(some: Sequence[Array], others: Sequence[Array], seed: int) -> dict[str, Any]:
    return {"value": rank_correlation(some, others), "95": bootstrap_interval(rank_correlation, some, others, seed)}


def _quarters(disagreement: Array, error: Array) -> list[dict[str, float]]:
    """Return disagreement and error (root of the mean square) in the quarters of all seconds by disagreement."""
    parts = np.array_split(np.argsort(disagreement, kind="stable"), min(QUARTERS, len(disagreement)))
    return [
        {
            "seconds": len(part),
            "disagreement": float(np.sqrt(np.square(disagreement[part]).mean())),
            "error": float(np.sqrt(np.square(error[part]).mean())),
        }
        for part in parts
    ]
