"""Pieces of recordings that say a text: the same selection, with joins where the sounds agree.

Source: Minnis & Breen 2000, §2: "why use two databases when one would suffice?"
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import SourcePiece
from lipmotion.engines.selection.concatenation import Piece, TimeMap, pieces_of
from lipmotion.engines.selection.config import SelectionConfig
from lipmotion.engines.selection.costs import JOIN_AFTER, JOIN_BEFORE, Costs, Target
from lipmotion.engines.selection.inventory import RecordedUnits, source_of
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.search import select
from lipmotion.engines.selection.windows import PHONE_NUMBER, phone_windows
from lipmotion.errors import InputError
from lipmotion.types import Timeline, Unit

Array = NDArray[np.float64]
SOUND: dict[str, Any] = {
    "guide": 0.0,
    "invisible": "",
    "overlap": "middle",
    "context": 1.0,
    "word": 0.3,
    "stress": 0.3,
    "duration": 0.5,
    "join": 0.05,
    "velocity": 0.0,
    "hard": 0.5,
    "protected": 0.0,
    "cluster": 0.5,
}
"""Costs where the sound counts: no phone is invisible, and no sound guides."""
ROUNDING_S = 1e-6


@dataclass(frozen=True, eq=False)
class AcousticUnits(RecordedUnits):
    """Units of which the sound is compared, not the motion.

    acoustic : acoustic features of all recordings, one after the other [shape=(F, D)]
    """

    acoustic: Array

    @cached_property
    def values(self) -> Array:
        """The acoustic features [shape=(F, D)]."""
        return self.acoustic


def source_pieces(
    model: SelectionModel,
    config: SelectionConfig,
    units: Timeline[Unit],
    recorded_features: Mapping[str, NDArray[np.floating[Any]]],
) -> tuple[tuple[SourcePiece, ...], Timeline[Unit]]:
    """Return pieces of recordings and the phones with their sources, as of ``SelectsRecordings``."""
    inventory = _with_sound(model.inventory, recorded_features)
    costs = Costs(inventory, replace(config, **SOUND), 1 / np.maximum(inventory.acoustic.std(axis=0), 1e-9))
    target = costs.target(phone_windows([units]), None, None)
    chosen = select(costs, target).units
    pieces = pieces_of(costs, target, chosen)
    sources = [source_of(inventory, unit) for unit in chosen.tolist()]
    found = [
        _source_piece(inventory, target, piece, following)
        for piece, following in zip(pieces, [*pieces[1:], None], strict=True)
    ]
    return tuple(found), with_sources(units, target.windows.times_s[:, 0], sources)


def typical_duration_s(inventory: RecordedUnits, phone: str) -> float:
    """Return the median duration of a phone, or that of all phones if none was recorded."""
    durations_s = inventory.windows.durations_s
    own = inventory.usable & (inventory.windows.phones == PHONE_NUMBER[phone])
    return float(np.median(durations_s[own if own.any() else inventory.usable]))


def with_sources(units: Timeline[Unit], starts_s: Array, sources: Sequence[str]) -> Timeline[Unit]:
    """Return the timeline with the source of the unit of every phone as the name of its unit.

    starts_s : start of every phone of the target
    """
    return Timeline(
        tuple(
            replace(span, label=replace(span.label, unit=sources[int(np.argmin(np.abs(starts_s - span.start_s)))]))
            for span in units
        )
    )


def _with_sound(inventory: RecordedUnits, recorded_features: Mapping[str, NDArray[np.floating[Any]]]) -> AcousticUnits:
    """Return the units with their sound. Raises InputError: features of other recordings, or of other lengths."""
    lengths = np.diff(inventory.first).tolist()
    for name, length in zip(inventory.names, lengths, strict=True):
        if name not in recorded_features or len(recorded_features[name]) != length:
            found = f"{len(recorded_features[name])} frames" if name in recorded_features else "nothing"
            raise InputError(
                f"recording {name}: {found} of sound, required {length} frames; give the corpus that the model learned"
            )
    features = np.concatenate([np.asarray(recorded_features[name], float) for name in inventory.names])
    return AcousticUnits(
        inventory.names, inventory.windows, inventory.usable, inventory.first, inventory.kept, inventory.motion, None,
        features,
    )  # fmt: skip


def _source_piece(inventory: RecordedUnits, target: Target, piece: Piece, following: Piece | None) -> SourcePiece:
    """Return a piece in the time of its recording, from the middle of one join to the middle of the next."""
    clock = TimeMap.of(inventory, target, piece, following)
    recorded, shift = inventory.windows.times_s, piece.unit - piece.first
    first = piece.first - (piece.join == JOIN_BEFORE)
    stop = piece.stop + (following is not None and following.join == JOIN_AFTER)
    begin_s, end_s = recorded[first + shift, 0], recorded[stop - 1 + shift, 1]
    if piece.first:
        begin_s = float(clock(np.array([piece.start_s]))[0])
    if following is not None:
        end_s = float(clock(np.array([following.start_s]))[0])
    starts = {
        number: float(recorded[number + shift, 0])
        for number in range(first, stop)
        if begin_s - ROUNDING_S <= recorded[number + shift, 0] < end_s - ROUNDING_S
    }
    name = inventory.names[inventory.windows.recording[piece.unit]]
    return SourcePiece(name, float(begin_s), max(float(end_s), float(begin_s)), starts)
