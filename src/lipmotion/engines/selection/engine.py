"""The unit selection engine."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit, Inputs, SourcePiece
from lipmotion.engines.selection.concatenation import Piece, TimeMap, join_motion, list_shown_units, to_pieces
from lipmotion.engines.selection.costs import Costs, SelectionConfig, Target, select
from lipmotion.engines.selection.inventory import PHONE_NUMBER, SOURCE, RecordedUnits, find_source, list_windows
from lipmotion.engines.selection.model import SelectionModel, model_arrays, model_from_arrays
from lipmotion.engines.selection.selection_training import build_target, fit_selection
from lipmotion.errors import InputError, shorten_list
from lipmotion.motion.predictors import count_conditions
from lipmotion.printable import printable
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Configuration, Constraints, Example, Generation, Monitor, Speech, StateTrace, Timeline, Unit

Array = NDArray[np.float64]
SOUND: dict[str, Any] = json.loads(Path(__file__).with_name("sound_costs.json").read_text(encoding="utf-8"))
"""Costs where the sound counts: no phone is invisible, and no sound guides."""
ROUNDING_S = 1e-6


def _name_sources(
    units: Timeline[Unit], target: Target, inventory: RecordedUnits, chosen: NDArray[np.intp]
) -> Timeline[Unit]:
    """Return the timeline with the unit of every phone named by its recorded source."""
    nearest = [int(np.argmin(np.abs(target.windows.times_s[:, 0] - span.start_s))) for span in units]
    sources = [find_source(inventory, int(chosen[number])) for number in nearest]
    labelled = zip(units, sources, strict=True)
    return Timeline(tuple(replace(span, label=replace(span.label, unit=source)) for span, source in labelled))


def _source_piece(inventory: RecordedUnits, target: Target, piece: Piece, following: Piece | None) -> SourcePiece:
    """Return a piece in the time of its recording, from the middle of one join to the middle of the next."""
    clock = TimeMap.of(inventory, target, piece)
    recorded, shift = inventory.windows.times_s, piece.unit - piece.first
    begin_s, end_s = recorded[piece.used.start + shift, 0], recorded[piece.used.stop - 1 + shift, 1]
    if piece.first:
        begin_s = float(clock(np.array([piece.start_s]))[0])
    if following is not None:
        end_s = float(clock(np.array([following.start_s]))[0])
    starts = {
        number: float(recorded[number + shift, 0])
        for number in piece.used
        if begin_s - ROUNDING_S <= recorded[number + shift, 0] < end_s - ROUNDING_S
    }
    name = inventory.names[inventory.windows.recording[piece.unit]]
    return SourcePiece(name, float(begin_s), max(float(end_s), float(begin_s)), starts)


LOG = logging.getLogger("lipmotion")
NAMED_UNITS = 3  # units that one warning names


@final
@dataclass(frozen=True)
class SelectionEngine(Engine[SelectionModel]):
    """Unit selection: recorded motion of phones in context, chosen by dynamic programming, warped in time and joined.

    Source: Minnis & Breen 2000.  Deviations: the motion that a guide predicts from the sound is part of the target
    costs; joins cost what the recorded motions differ by; overlaps are raised cosines; the suppressed phones are
    one symbol, so that units may merge in any of them.
    """

    config: SelectionConfig
    name: ClassVar[str] = "selection"
    Config: ClassVar[type[Configuration]] = SelectionConfig

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: D102
        guide = self.config.guide > 0
        conditions = count_conditions(self.config.predictor, motion_s, self.config.conditions) if guide else 0
        return Inputs(self.config.joint_recogniser, conditions, prior=guide, posteriors=guide, encoding=guide)

    def fit(  # noqa: D102
        self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
    ) -> Fit[SelectionModel]:
        model, deviations = fit_selection(examples, self.config, monitor, checkpoint)
        frames = sum(int(example.valid.sum()) for example in examples)
        figures = {"frames": frames, "units": int(model.inventory.usable.sum()), "deviation": float(deviations[0])}
        return Fit(model, figures, model.guide is not None and model.guide.predictor.uses_prior)

    def recognise(self, model: SelectionModel, speech: Speech) -> Timeline[Unit] | None:  # noqa: D102
        return model.phone_recogniser.phones(speech) if model.phone_recogniser is not None else None

    def generate(self, model: SelectionModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        costs = model.costs(self.config)
        target = build_target(model, costs, speech)
        frames = len(speech.features.values)
        units = select(costs, target, required=_find_named_units(costs, target, speech.units))[0]
        pieces = to_pieces(costs, target, units)
        motion, variance = join_motion(model, costs, target, units, pieces, speech, constraints)
        shown, places = np.unique(list_shown_units(target, pieces, frames), return_inverse=True)
        trace = StateTrace(tuple(find_source(costs.inventory, unit) for unit in shown.tolist()), places.astype(np.intp))
        return Generation(motion, variance, _name_sources(speech.units, target, costs.inventory, units), trace)

    def recordings(self, model: SelectionModel) -> tuple[str, ...]:  # noqa: D102
        return model.inventory.names

    def stand_ins(self, model: SelectionModel) -> Mapping[str, str]:  # noqa: D102
        suppressed = self.config.suppressed_phones
        return {phone: other for phone, other in model.costs(self.config).stand_ins.items() if phone not in suppressed}

    def typical_duration_s(self, model: SelectionModel, phone: str) -> float:  # noqa: D102
        windows, usable = model.inventory.windows, model.inventory.usable
        alike = usable & (windows.phones == PHONE_NUMBER[phone])
        return float(np.median(windows.durations_s[alike if alike.any() else usable]))

    def source_pieces(  # noqa: D102
        self, model: SelectionModel, units: Timeline[Unit], features: Mapping[str, NDArray[np.floating[Any]]]
    ) -> tuple[tuple[SourcePiece, ...], Timeline[Unit]]:
        inventory, lengths = model.inventory, np.diff(model.inventory.first).tolist()
        for name, length in zip(inventory.names, lengths, strict=True):
            if name not in features or len(features[name]) != length:
                found = f"{len(features[name])} frames" if name in features else "nothing"
                raise InputError(
                    f"recording {name}: {found} of sound, required {length} frames; give the learned corpus"
                )
        sound = np.concatenate([np.asarray(features[name], float) for name in inventory.names])
        inventory = replace(inventory, stored_ranges=np.array([[0, len(sound)]]), motion=sound, predicted=None)
        costs = Costs(inventory, replace(self.config, **SOUND), 1 / np.maximum(sound.std(axis=0), 1e-9))
        target = costs.target(list_windows([units]), None, None)
        chosen = select(costs, target)[0]
        pieces = to_pieces(costs, target, chosen)
        pairs = zip(pieces, [*pieces[1:], None], strict=True)
        sources = tuple(_source_piece(inventory, target, *pair) for pair in pairs)
        return sources, _name_sources(units, target, inventory, chosen)

    def to_arrays(self, model: SelectionModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        return model_arrays(model)

    def from_arrays(self, arrays: Arrays) -> SelectionModel:  # noqa: D102
        return model_from_arrays(arrays)


def _find_named_units(costs: Costs, target: Target, units: Timeline[Unit]) -> dict[int, int]:
    """Return the units that edited labels name, by phone; those of another symbol than their phone are ignored."""
    if target.by_sound:
        return {}
    inventory, recordings = costs.inventory, {span.label.unit.split(" ")[0] for span in units if span.label.unit}
    numbers = [number for number, name in enumerate(inventory.names) if name.split(" ")[0] in recordings]
    candidates = np.flatnonzero(np.isin(inventory.windows.recording, numbers) & inventory.usable).tolist()
    named = {find_source(inventory, unit): unit for unit in candidates}
    starts_s, symbols = target.windows.times_s[:, 0], costs.index.contexts[:, costs.config.window // 2]
    required, useless = {}, []
    for span in units:
        if span.duration_s <= 0 or not SOURCE.search(span.label.unit):
            continue
        unit, number = named.get(span.label.unit), int(np.argmin(np.abs(starts_s - span.start_s)))
        if unit is not None and symbols[unit] == target.symbol(number):
            required[number] = unit
        else:
            useless.append(f"{span.label.phone} at {span.start_s:.2f} s: {span.label.unit!r}")
    if useless:
        LOG.warning(
            "%d of %d units name no recorded unit of their phone in this model (%s); these phones are selected again",
            *(len(useless), len(units), printable(shorten_list(useless, NAMED_UNITS))),
        )
    return required
