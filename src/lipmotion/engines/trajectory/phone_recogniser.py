"""The joint model finds the phones of voices that it knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.multistream.arrays import joint_arrays, joint_from_arrays
from lipmotion.hmm.multistream.inventory import Inventory
from lipmotion.hmm.multistream.labels import units_in_frames, units_in_time
from lipmotion.hmm.multistream.model import JointConfig, JointHmm
from lipmotion.hmm.multistream.recognise import joint_recogniser
from lipmotion.hmm.multistream.streams import SPEECH, StreamObservations, stream_observations
from lipmotion.hmm.multistream.train import TrainingUtterance, train_joint
from lipmotion.storage.checkpoint import Checkpoint
from lipmotion.storage.schema import Arrays, ArraySpec, arrays_under, checked_arrays
from lipmotion.types import FRAME_RATE_HZ, Example, Monitor, Speech, Timeline, Unit
from lipmotion.units import UNIT_SETS, is_silent

PHONES = UNIT_SETS["phone"]
CONFIG = JointConfig(mixtures=16)
LEAST_MINUTES = 8.0
"""With less speech to learn from, the phones are found better with the help of the models of many voices."""
LONGEST_S = 120.0
"""Longer recordings are left to the other recogniser, which works block by block."""
SIMILARITY_MARGIN = -6.0
"""A voice is known whose sound the model explains at most this much worse than its training data (mean log density of a
frame under what fits it best). GRID's s1 in other recordings: -6 to 2; five others of the same studio: -9 to -7."""
SIMILARITY_FRAMES = 400
"""So many frames, spread evenly, tell whether a voice is known."""
_CHECKPOINT = "joint"
JOINT_PREFIX = "joint_"
"""What the names of its arrays begin with."""
TYPICAL = {"typical": ArraySpec(np.float64, "1", -1e6, 1e6)}


@dataclass(frozen=True, eq=False)
class OwnPhoneRecogniser:
    """The joint model as a recogniser of phones.

    typical : how well it explains its training data
    """

    hmm: JointHmm
    training_score: float

    def phones(self, speech: Speech) -> Timeline[Unit] | None:
        """Return the phones that were most probably said; None where the voice is not known, or the recording too long.

        They are placed as this model hears them, which is not how the recogniser places those of a transcript.
        """
        observed = _observed(speech)
        long = observed.frames > LONGEST_S * FRAME_RATE_HZ
        if (
            long
            or not speech.features.values.any()
            or _fit(self.hmm, observed) < self.training_score + SIMILARITY_MARGIN
        ):
            return None
        try:
            found = joint_recogniser(self.hmm).recognise(observed)
        except AlignmentError:  # shorter than any phone
            return None
        return units_in_time(found, speech.features.duration_s)


def fit_phone_recogniser(
    examples: Sequence[Example], values: Sequence[NDArray[np.float64]], monitor: Monitor, checkpoint: Checkpoint
) -> OwnPhoneRecogniser | None:
    """Return a listener trained on sound and motion; None where there is too little, or nothing is said.

    values : every example's motion in the model's space [each shape=(T, Q)]
    Source: Hofer 2008, §4 to §6: all streams are trained together; only the heard ones recognise.
    """
    spoken_s = sum(s.duration_s for e in examples for s in e.speech.units if not is_silent(s.label.phone))
    if spoken_s < 60 * LEAST_MINUTES:
        return None
    kept = checkpoint.load(_CHECKPOINT)
    if kept is None:
        hmm = train_joint(
            [_transcribed(example, x) for example, x in zip(examples, values, strict=True)],
            Inventory(PHONES.units, PHONES.silence, CONFIG.states),
            PHONES.classes(),
            CONFIG,
            monitor,
        )
        kept = joint_arrays(hmm, np.float32)
        checkpoint.save(_CHECKPOINT, kept)
    hmm = joint_from_arrays(kept, CONFIG)
    return OwnPhoneRecogniser(hmm, float(np.mean([_fit(hmm, _observed(example.speech)) for example in examples])))


def recogniser_arrays(listener: OwnPhoneRecogniser) -> dict[str, NDArray[Any]]:
    """Return a listener as arrays, at half precision."""
    arrays = joint_arrays(listener.hmm) | {"typical": np.array([listener.training_score])}
    return {f"{JOINT_PREFIX}{name}": array for name, array in arrays.items()}


def recogniser_from_arrays(arrays: Arrays) -> OwnPhoneRecogniser | None:
    """Return it again, or None. Raises ModelFormatError, KeyError, ValueError: something is missing or damaged."""
    own = arrays_under(arrays, JOINT_PREFIX)
    if not own:
        return None
    (typical,) = checked_arrays(own, TYPICAL)["typical"].tolist()
    hmm = joint_from_arrays({name: array for name, array in own.items() if name not in TYPICAL}, CONFIG)
    if set(hmm.inventory.names) != set(PHONES.units):
        raise ValueError(f"the units {' '.join(hmm.inventory.names)}, required {' '.join(PHONES.units)}")
    return OwnPhoneRecogniser(hmm, typical)


def _observed(speech: Speech) -> StreamObservations:
    return stream_observations(np.asarray(speech.features.values), speech.log_f0)


def _transcribed(example: Example, values: NDArray[np.float64]) -> TrainingUtterance:
    speech = example.speech
    observed = stream_observations(np.asarray(speech.features.values), speech.log_f0, values, example.valid)
    units, bounds = units_in_frames(speech.units, observed.frames, PHONES.silence[0], PHONES.unit_of)
    return TrainingUtterance(observed, units, bounds)


def _fit(hmm: JointHmm, observed: StreamObservations) -> float:
    """Return the mean log density of some frames' features, each under the leaf that fits it best."""
    part = hmm.models[SPEECH]
    rows = hmm.standardise(observed, hmm.config.recognition)[SPEECH]
    chosen = rows[np.linspace(0, len(rows) - 1, min(len(rows), SIMILARITY_FRAMES)).astype(int)]
    leaves = np.arange(part.forest.size)
    return float(part.tied.log_density(chosen, leaves, part.scale.log_determinant).max(axis=1).mean())
