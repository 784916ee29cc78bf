"""The model of the unit selection engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.costs import FRACTIONS, POINTS, Costs, SelectionConfig
from lipmotion.engines.selection.inventory import PhoneWindows, RecordedUnits
from lipmotion.hmm.multistream.phone_recogniser import (
    JOINT_PREFIX,
    OwnPhoneRecogniser,
    recogniser_from_arrays,
    recogniser_to_arrays,
)
from lipmotion.motion.arrays import LEARNED_MOTION_ARRAYS, learned_motion_from_arrays, learned_motion_to_arrays
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.predictors import Predictor, list_predictor_arrays, predictor_from_arrays, predictor_to_arrays
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import FRAME_RATE_HZ
from lipmotion.types.motion import interpolate_rows
from lipmotion.units import PHONES


@dataclass(frozen=True, eq=False)
class Guide:
    """A predictor of motion; mean of the motion [shape=(Q,)], and its deviation by that of predictions [shape=(Q,)]."""

    predictor: Predictor
    centre: Array
    expansion: Array


def interpolate_at(motion: Array, times_s: Array) -> Array:
    """Return motion of one recording [shape=(T, Q)] at the points of each of its phones [shape=(U, POINTS, Q)]."""
    start_s, end_s = times_s.T[:, :, None]
    points_s = start_s + FRACTIONS * (end_s - start_s)
    return interpolate_rows(motion, FRAME_RATE_HZ, points_s.ravel()).reshape(*points_s.shape, -1)


Array = NDArray[np.float64]
LONGEST_SILENCE_FRAMES = 100  # at least one of so many frames is stored
LATE_S = 1.0  # units end at most so long after the motion of their recording


@dataclass(frozen=True, eq=False)
class SelectionModel:
    """Recorded phones with their motion, and what chooses among them.

    scale     : factors of the dimensions of motion in comparisons [shape=(Q,)]
    variances : of the error of static value, Δ and Δ² on recordings that were left out [shape=(3, Q)]
    guide     : predicts motion from the sound (None: the phones alone choose)
    phone_recogniser : recognises the phones of speakers that it was trained on (None: there was too little speech)
    """

    motion: LearnedMotion
    inventory: RecordedUnits
    scale: Array
    rest: Array
    variances: Array
    guide: Guide | None
    phone_recogniser: OwnPhoneRecogniser | None

    def __repr__(self) -> str:
        return f"SelectionModel({len(self.inventory.names)} recordings, {len(self.inventory.usable)} recorded phones)"

    def costs(self, config: SelectionConfig) -> Costs:
        """Return the costs of units, for a configuration; those of the last one are kept."""
        if config not in self._costs:
            self._costs.clear()
            self._costs[config] = Costs(self.inventory.without(config.suppressed_phones), config, self.scale)
        return self._costs[config]

    @cached_property
    def _costs(self) -> dict[SelectionConfig, Costs]:
        return {}


def model_arrays(model: SelectionModel) -> dict[str, NDArray[Any]]:
    """Serialise a model."""
    inventory, windows = model.inventory, model.inventory.windows
    arrays: dict[str, NDArray[Any]] = {
        "recordings": np.array(inventory.names),
        "recording_first": inventory.first,
        "unit_recording": windows.recording,
        "unit_phones": windows.phones.astype(np.int32),
        "unit_times": windows.times_s,
        "unit_words": windows.words,
        "unit_stress": windows.stress.astype(np.int32),
        "unit_usable": inventory.usable,
        "recorded_rows": inventory.stored_ranges,
        "recorded_motion": inventory.motion,
        "selection_scale": model.scale,
        "selection_rest": model.rest,
        "selection_variances": model.variances,
    }
    if model.guide is not None and inventory.predicted is not None:
        arrays |= predictor_to_arrays(model.guide.predictor)
        arrays |= {
            "guide_range": np.stack([model.guide.centre, model.guide.expansion]),
            "unit_predicted": inventory.predicted,
        }
    recogniser = recogniser_to_arrays(model.phone_recogniser) if model.phone_recogniser is not None else {}
    return learned_motion_to_arrays(model.motion) | arrays | recogniser


def model_from_arrays(arrays: Arrays) -> SelectionModel:
    """Deserialise a model. Raises ModelFormatError: a missing or wrong array."""
    with format_errors("the model of recorded units"):
        named = (name for name in arrays if name.startswith(JOINT_PREFIX))
        refuse_undeclared(arrays, LEARNED_MOTION_ARRAYS, list_predictor_arrays(arrays), UNITS, GUIDE, named)
        motion = learned_motion_from_arrays(arrays)
        dimensions = motion.space.dimensions
        stored = check_arrays(arrays, UNITS, Q=dimensions)
        predictor = predictor_from_arrays(arrays, dimensions)
        guide, predicted = None, None
        if predictor is not None:
            guided = check_arrays(arrays, GUIDE, Q=dimensions, U=stored.sizes["U"])
            guide, predicted = Guide(predictor, *guided["guide_range"]), guided["unit_predicted"].astype(np.float16)
            if not (guide.expansion > 0).all():
                raise ValueError("guide_range with an expansion that is not more than 0")
        inventory = RecordedUnits(
            tuple(map(str, stored["recordings"].tolist())),
            PhoneWindows(
                stored["unit_recording"],
                stored["unit_phones"].astype(np.int16),
                stored["unit_times"],
                stored["unit_words"],
                stored["unit_stress"].astype(np.int8),
            ),
            stored["unit_usable"],
            stored["recording_first"],
            stored["recorded_rows"],
            stored["recorded_motion"].astype(np.float16),
            predicted,
        )
        _check(inventory)
        return SelectionModel(
            motion,
            inventory,
            stored["selection_scale"],
            stored["selection_rest"],
            stored["selection_variances"],
            guide,
            recogniser_from_arrays(arrays),
        )


UNITS = {
    "recordings": ArraySpec(np.str_, "R"),
    "recording_first": ArraySpec(np.intp, "B", 0, 1e9),
    "unit_recording": ArraySpec(np.int32, "U", 0, 1e7),
    "unit_phones": ArraySpec(np.int32, "U", 0, len(PHONES) - 1),
    "unit_times": ArraySpec(np.float64, "U 2", 0, 1e7),
    "unit_words": ArraySpec(np.bool_, "U 2"),
    "unit_stress": ArraySpec(np.int32, "U", -1, 2),
    "unit_usable": ArraySpec(np.bool_, "U"),
    "recorded_rows": ArraySpec(np.intp, "K 2", 0, 1e9),
    "recorded_motion": ArraySpec(np.float32, "N Q", -6e4, 6e4),
    "selection_scale": ArraySpec(np.float64, "Q", POSITIVE, 1e9),
    "selection_rest": ArraySpec(np.float64, "Q", -1e6, 1e6),
    "selection_variances": ArraySpec(np.float64, "3 Q", 1e-30),
}
GUIDE = {
    "guide_range": ArraySpec(np.float64, "2 Q", -1e6, 1e6),
    "unit_predicted": ArraySpec(np.float32, f"U {POINTS} Q", -6e4, 6e4),
}


def _check(inventory: RecordedUnits) -> None:
    windows, first, rows = inventory.windows, inventory.first, inventory.stored_ranges.ravel()
    if len(first) != len(inventory.names) + 1 or first[0] != 0 or (np.diff(first) < 1).any():
        raise ValueError("recording_first is not rising from 0, with one number for each recording and one more")
    stored = int(np.diff(inventory.stored_ranges, axis=1).sum())
    if (np.diff(rows) < 0).any() or rows[-1] > first[-1] or (np.diff(inventory.stored_ranges, axis=1) < 1).any():
        raise ValueError(f"recorded_rows that are not ranges in ascending order within {first[-1]} rows")
    if len(inventory.motion) != stored:
        raise ValueError(f"recorded_motion of {len(inventory.motion)} rows, required {stored}")
    if (np.diff(windows.recording) < 0).any() or windows.recording.max() >= len(inventory.names):
        raise ValueError("units that are not in the order of the recordings")
    if (windows.durations_s < 0).any() or not inventory.usable.any():
        raise ValueError("units of negative duration, or none that is usable")
    if first[-1] > LONGEST_SILENCE_FRAMES * stored:
        raise ValueError(f"{stored} of {first[-1]} frames of motion are stored, required 1 of {LONGEST_SILENCE_FRAMES}")
    ends_s = np.diff(first)[windows.recording] / FRAME_RATE_HZ + LATE_S
    if (windows.times_s[:, 1] > ends_s).any():
        raise ValueError("units beyond the end of their recording")
