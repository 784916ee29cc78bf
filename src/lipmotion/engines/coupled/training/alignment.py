"""Utterances with phone labels in time, and what follows from the labels: allowed units, a first path, bigrams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations
from lipmotion.engines.coupled.chains.product import Grammar, JointState, Product
from lipmotion.engines.coupled.chains.structures import Structure
from lipmotion.hmm.multistream.unit_states import units_to_frames
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.types import FRAME_RATE_HZ, Timeline, Unit
from lipmotion.units import SILENCE

Index = NDArray[np.intp]
SLACK_S = 0.05
"""A unit is allowed this long before and after its label."""
FIRST_SHARE = 0.1
"""Share of the probability of the first unit that is spread over all units, whatever utterances begin with."""


@dataclass(frozen=True, eq=False)
class AlignedUtterance:
    """The observations of an utterance, and its phones in time."""

    observations: AudioVisualObservations
    phones: Timeline[Unit]


def mark_allowed_units(structure: Structure, phones: Timeline[Unit], frames: int) -> NDArray[np.bool_]:
    """Return the units that each frame may belong to [shape=(T, U)]: labelled near it; without a label, silence."""
    names, first = structure.units[0], structure.chains[0]
    allowed = np.zeros((frames, len(names)), bool)
    slack = round(SLACK_S * FRAME_RATE_HZ)
    for unit, start, stop in list_unit_segments(structure, phones, frames):
        allowed[max(start - slack, 0) : stop + slack, unit] = True
    unlabelled = ~allowed.any(axis=1)
    for silence in first.silence:
        allowed[unlabelled, names.index(silence)] = True
    return allowed


def list_unit_segments(structure: Structure, phones: Timeline[Unit], frames: int) -> list[tuple[int, int, int]]:
    """Return the unit of the first chain, the first frame, and the frame after the last, of every non-empty label."""
    names, bounds = units_to_frames(phones, frames, SILENCE)
    units = [structure.units[0].index(structure.chains[0].unit(name)) for name in names]
    return list(zip(units, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True))


def split_evenly(product: Product, phones: Timeline[Unit], frames: int) -> Index:
    """Return the joint states [shape=(T,)] of uniform segmentation: all chains divide every label into equal parts."""
    structure, chains = product.structure, range(len(product.structure.chains))
    number = {joint: index for index, joint in enumerate(product.joint_states)}
    path = np.empty(frames, np.intp)
    for unit, start, stop in list_unit_segments(structure, phones, frames):
        units = tuple(structure.corresponding_units[c][unit] for c in chains)
        for frame in range(start, stop):
            state = (frame - start) * structure.states // (stop - start)
            path[frame] = number[JointState(units, (state,) * len(chains), (False,) * len(chains))]
    return path


def estimate_grammar(structure: Structure, data: Sequence[AlignedUtterance]) -> Grammar:
    """Return the bigrams, and the probabilities of the first unit, of every chain, from labels."""
    sentences = [
        [unit for unit, _, _ in list_unit_segments(structure, utterance.phones, utterance.observations.frames)]
        for utterance in data
    ]
    bigrams, initials = [], []
    for units, corresponding in zip(structure.units, structure.corresponding_units, strict=True):
        chain_sentences = [[units[corresponding[unit]] for unit in sentence] for sentence in sentences]
        bigrams.append(np.exp(estimate_bigram(units, chain_sentences).log_probability.astype(float)))
        initial = np.full(len(units), FIRST_SHARE / len(units))
        for sentence in chain_sentences:
            initial[units.index(sentence[0])] += (1 - FIRST_SHARE) / len(chain_sentences)
        initials.append(initial)
    return Grammar(tuple(bigrams), tuple(initials))
