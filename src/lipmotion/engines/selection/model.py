"""The model of the unit selection engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.config import SelectionConfig
from lipmotion.engines.selection.costs import POINTS, Costs
from lipmotion.engines.selection.guide import Guide
from lipmotion.engines.selection.inventory import RecordedUnits
from lipmotion.engines.selection.windows import PhoneWindows
from lipmotion.hmm.multistream.phone_recogniser import (
    JOINT_PREFIX,
    OwnPhoneRecogniser,
    recogniser_arrays,
    recogniser_from_arrays,
)
from lipmotion.motion.arrays import LEARNED_MOTION_ARRAYS, learned_motion_arrays, learned_motion_from_arrays
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.motion_store import motion_store_arrays, motion_store_from_arrays
from lipmotion.motion.predictors import names_of_predictors, predictor_arrays, predictor_from_arrays
from lipmotion.storage.schema import (
    POSITIVE,
    Arrays,
    ArraySpec,
    arrays_under,
    checked_arrays,
    format_errors,
    refuse_undeclared,
)
from lipmotion.types import FRAME_RATE_HZ
from lipmotion.units import PHONES

Array = NDArray[np.float64]
LONGEST_SILENCE_FRAMES = 100
"""At least one of so many frames is stored."""
LATE_S = 1.0
"""Units end at most so long after the motion of their recording."""
STORE_PREFIX = "store_"
"""Beginning of the names of the arrays of the motion store."""


@dataclass(frozen=True, eq=False)
class SelectionModel:
    """Recorded phones with their motion, and what chooses among them.

    motion    : turns motion in the motion space into that of all channels, with closures and limits
    inventory : the recorded phones
    scale     : factors of the dimensions of motion in comparisons [shape=(Q,)]
    rest      : the rest pose [shape=(Q,)]
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
        "selection_scale": model.scale,
        "selection_rest": model.rest,
        "selection_variances": model.variances,
    }
    arrays |= {f"{STORE_PREFIX}{name}": array for name, array in motion_store_arrays(inventory.motion).items()}
    if model.guide is not None and inventory.predicted is not None:
        arrays |= predictor_arrays(model.guide.predictor)
        arrays |= {
            "guide_range": np.stack([model.guide.centre, model.guide.expansion]),
            "unit_predicted": inventory.predicted,
        }
    recogniser = recogniser_arrays(model.phone_recogniser) if model.phone_recogniser is not None else {}
    return learned_motion_arrays(model.motion) | arrays | recogniser


def model_from_arrays(arrays: Arrays, *, filtered: bool) -> SelectionModel:
    """Deserialise a model.

    filtered : there must be a modulation filter
    Raises ModelFormatError: an array is missing or undeclared, or has a wrong shape, type or range.
    """
    with format_errors("the model of recorded units"):
        named = (name for name in arrays if name.startswith((JOINT_PREFIX, STORE_PREFIX)))
        refuse_undeclared(arrays, LEARNED_MOTION_ARRAYS, names_of_predictors(arrays), UNITS, GUIDE, named)
        motion = learned_motion_from_arrays(arrays, filtered=filtered)
        dimensions = motion.space.dimensions
        stored = checked_arrays(arrays, UNITS, Q=dimensions)
        predictor = predictor_from_arrays(arrays, dimensions)
        guide, predicted = None, None
        if predictor is not None:
            guided = checked_arrays(arrays, GUIDE, Q=dimensions, U=stored.sizes["U"])
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
            motion_store_from_arrays(arrays_under(arrays, STORE_PREFIX)),
            predicted,
        )
        _check(inventory, dimensions)
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
    "selection_scale": ArraySpec(np.float64, "Q", POSITIVE, 1e9),
    "selection_rest": ArraySpec(np.float64, "Q", -1e6, 1e6),
    "selection_variances": ArraySpec(np.float64, "3 Q", 1e-30),
}
GUIDE = {
    "guide_range": ArraySpec(np.float64, "2 Q", -1e6, 1e6),
    "unit_predicted": ArraySpec(np.float32, f"U {POINTS} Q", -6e4, 6e4),
}


def _check(inventory: RecordedUnits, dimensions: int) -> None:
    """Raise ValueError if the parts of an inventory contradict one another."""
    windows, first, motion = inventory.windows, inventory.first, inventory.motion
    if len(first) != len(inventory.names) + 1 or first[0] != 0 or (np.diff(first) < 1).any():
        raise ValueError("recording_first is not rising from 0, with one number for each recording and one more")
    if len(motion) != first[-1] or len(motion.tolerance) != dimensions:
        raise ValueError(f"motion of {len(motion)} frames, required {first[-1]} of {dimensions} dimensions")
    if (np.diff(windows.recording) < 0).any() or windows.recording.max() >= len(inventory.names):
        raise ValueError("units that are not in the order of the recordings")
    if (windows.durations_s < 0).any() or not inventory.usable.any():
        raise ValueError("units of negative duration, or none that is usable")
    stored = int(np.diff(motion.kept, axis=1).sum())
    if len(motion) > LONGEST_SILENCE_FRAMES * stored:
        raise ValueError(
            f"{stored} of {len(motion)} frames of motion are stored, required 1 of {LONGEST_SILENCE_FRAMES}"
        )
    ends_s = np.diff(first)[windows.recording] / FRAME_RATE_HZ + LATE_S
    if (windows.times_s[:, 1] > ends_s).any():
        raise ValueError("units beyond the end of their recording")
