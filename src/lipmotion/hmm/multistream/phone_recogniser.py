"""Recognition of phones by the joint model, for speakers that it was trained on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.multistream.densities import SPEECH, StreamObservations, stream_observations
from lipmotion.hmm.multistream.model import JointConfig, JointHmm, joint_from_arrays, joint_to_arrays
from lipmotion.hmm.multistream.recognise import recognise_units
from lipmotion.hmm.multistream.unit_states import Inventory, frames_to_units, units_to_frames
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, select_arrays
from lipmotion.types import FRAME_RATE_HZ, Example, Monitor, Speech, Timeline, Unit
from lipmotion.units import UNIT_SETS, is_silent

PHONES = UNIT_SETS["phone"]
CONFIG = JointConfig(mixtures=16)
MIN_MINUTES = 8.0
"""Smallest amount of speech for training; with less, the models of many voices recognise phones better."""
LONGEST_S = 120.0  # longer recordings are left to the shared recogniser, which works block by block
SIMILARITY_MARGIN = -6.0
"""A speaker counts as one of the training if the speaker similarity score exceeds that of the training data plus this.
Minus that, measured: GRID's s1 in other recordings -6 to 2; five other speakers of the same studio -9 to -7."""
SIMILARITY_FRAMES = 400  # frames, spread evenly over a recording, from which the speaker similarity score is computed
JOINT_PREFIX = "joint_"
SCORE = {"typical": ArraySpec(np.float64, "1", -1e6, 1e6)}


@dataclass(frozen=True, eq=False)
class OwnPhoneRecogniser:
    """The joint model as a recogniser of phones, and the mean speaker similarity score of its training data."""

    hmm: JointHmm
    training_score: float

    def phones(self, speech: Speech) -> Timeline[Unit] | None:
        """Return the most probable phones in time, or None.

        None: the speaker is not one of the training, the recording is too long, or it is shorter than any phone. The
        boundaries are those of this model; they differ from those of the recogniser that aligns transcripts.
        """
        observations = stream_observations(speech.features.values, speech.log_f0)
        if observations.frames > LONGEST_S * FRAME_RATE_HZ or not speech.features.values.any():
            return None
        if _score_similarity(self.hmm, observations) < self.training_score + SIMILARITY_MARGIN:
            return None
        try:
            units, bounds = recognise_units(self.hmm, observations)
        except AlignmentError:  # shorter than any phone
            return None
        return frames_to_units(map(Unit, units), bounds, speech.features.duration_s)


def fit_phone_recogniser(
    examples: Sequence[Example],
    values: Sequence[NDArray[np.float64]],
    monitor: Monitor,
    checkpoint: Checkpoint,
    min_minutes: float = MIN_MINUTES,
) -> OwnPhoneRecogniser | None:
    """Return a recogniser of phones that is trained on sound and motion, or None if there is too little speech.

    Source: Hofer 2008, §4 to §6: all streams are trained together; those of speech and F0 are used in recognition.
    """
    spoken_s = sum(s.duration_s for e in examples for s in e.speech.units if not is_silent(s.label.phone))
    if spoken_s < 60 * min_minutes:
        return None
    arrays = checkpoint.load("joint")
    if arrays is None:
        from lipmotion.hmm.multistream.multistream_training import TrainingUtterance, grow_joint

        utterances = []
        for example, x in zip(examples, values, strict=True):
            speech = example.speech
            observed = stream_observations(speech.features.values, speech.log_f0, x, example.valid)
            units, bounds = units_to_frames(speech.units, observed.frames, PHONES.silence[0], PHONES.unit_of)
            utterances.append(TrainingUtterance(observed, units, bounds))
        inventory = Inventory(PHONES.units, PHONES.silence, CONFIG.states)
        *_, hmm = grow_joint(utterances, inventory, PHONES.classes(), CONFIG, monitor, checkpoint)
        arrays = joint_to_arrays(hmm, np.float32)
        checkpoint.save("joint", arrays)
    hmm = joint_from_arrays(arrays, CONFIG)
    observations = (stream_observations(example.speech.features.values, example.speech.log_f0) for example in examples)
    scores = [_score_similarity(hmm, each) for each in observations]
    return OwnPhoneRecogniser(hmm, float(np.mean(scores)))


def recogniser_to_arrays(recogniser: OwnPhoneRecogniser) -> dict[str, NDArray[Any]]:
    """Serialise a recogniser, at half precision."""
    arrays = joint_to_arrays(recogniser.hmm) | {"typical": np.array([recogniser.training_score])}
    return {f"{JOINT_PREFIX}{name}": array for name, array in arrays.items()}


def recogniser_from_arrays(arrays: Arrays) -> OwnPhoneRecogniser | None:
    """Deserialise a recogniser; None: there is none. Raises ModelFormatError, KeyError, ValueError: a wrong array."""
    joint = select_arrays(arrays, JOINT_PREFIX)
    if not joint:
        return None
    (score,) = check_arrays(joint, SCORE)["typical"].tolist()
    hmm = joint_from_arrays({name: array for name, array in joint.items() if name not in SCORE}, CONFIG)
    if set(hmm.inventory.names) != set(PHONES.units):
        raise ValueError(f"the units {' '.join(hmm.inventory.names)}, required {' '.join(PHONES.units)}")
    return OwnPhoneRecogniser(hmm, score)


def _score_similarity(hmm: JointHmm, observations: StreamObservations) -> float:
    """Return the speaker similarity score: the mean over frames of the log density of the leaf that fits best."""
    part = hmm.models[SPEECH]
    rows = hmm.standardise(observations, hmm.config.recognition)[SPEECH]
    chosen = rows[np.linspace(0, len(rows) - 1, min(len(rows), SIMILARITY_FRAMES)).astype(int)]
    density = part.tied.log_density(chosen, np.arange(part.forest.size), part.scale.log_determinant)
    return float(density.max(axis=1).mean())
