"""The own and the general phone models combined: their units, and the weighted sum of their log densities."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.model import StateTable, UnitHmm
from lipmotion.hmm.network import DensitySelection, LogLikelihoods
from lipmotion.speech.recognition.general.acoustic import density_column, general_model
from lipmotion.speech.recognition.general.language import english_bigram
from lipmotion.stats.bigram import Bigram
from lipmotion.units import PHONES, SILENCE, find_similar_phone, is_silent

NOISES = ("+nsn+", "+spn+")
"""Units that only the general models have: noise, and noise of the mouth (a breath, a cough)."""
ENGLISH_SHARE = 0.5
"""Weight of the English bigram; the rest is the weight of the bigram of the own corpus."""
BIGRAM_WEIGHT, INSERTION_SCORE = 3.0, -4.0
KEPT_FRAMES = 400_000
"""The general log densities of a recording of up to so many frames, about an hour, are kept: they are asked for twice
and take 500 bytes a frame. Those of a longer recording are computed twice."""


class CombinedPhones(NamedTuple):
    """Models of every phone of the inventory and of the noises.

    hmm     : the own models; a phone without an own model borrows that of the most similar phone with one
              (``units.SIMILAR_PHONES``)
    columns : the general density that goes with each of its densities [shape=(G,)]
    """

    hmm: UnitHmm
    columns: NDArray[np.intp]


def combine_phones(own: UnitHmm) -> CombinedPhones:
    """Return the own models extended to all phones. Raises MissingDependencyError: pocketsphinx is not installed."""
    old, modelled = own.table, [unit for unit in own.table.units if not is_silent(unit)]
    new = tuple(unit for unit in (*PHONES, *NOISES) if unit not in old.units)
    borrowed = [SILENCE if unit in NOISES or is_silent(unit) else find_similar_phone(unit, modelled) for unit in new]
    plain = len(own.log_stay)
    added = [(unit, state, old.density(source, state)) for unit, source in zip(new, borrowed, strict=True)
             for state in range(old.count(source))]  # fmt: skip
    table = StateTable(
        units=old.units + new,
        counts=old.counts + tuple(old.count(source) for source in borrowed),
        names=(*old.names[:plain], *(f"{unit}.{state}" for unit, state, _ in added), *old.names[plain:]),
        free=(*old.free, *(unit for unit in new if unit in NOISES or is_silent(unit))),
    )
    sources = np.array([*range(plain), *(source for *_, source in added), *range(plain, len(old.names))], np.intp)
    hmm = replace(
        own,
        config=replace(own.config, bigram_weight=BIGRAM_WEIGHT, insertion=INSERTION_SCORE),
        table=table,
        mixtures=own.mixtures.select(sources),
        log_stay=own.log_stay[sources[: plain + len(added)]],
        bigram=_bigram(own.bigram, table.units),
    )
    return CombinedPhones(hmm, np.array([_column(table, name) for name in table.names], np.intp))


def _column(table: StateTable, name: str) -> int:
    """Return the general density that goes with a density of the table, by its name."""
    unit, _, rest = name.partition(".")
    return density_column(unit, int(rest.partition("<")[0].partition(">")[0]), table.count(unit))


def _bigram(own: Bigram, units: tuple[str, ...]) -> Bigram:
    """Return the own bigram mixed with that of English; after phones that are not in the own corpus, English alone."""
    english = english_bigram(units)
    mixed, count = english.copy(), len(own.units)
    mixed[:count] *= ENGLISH_SHARE
    mixed[:count, :count] += (1 - ENGLISH_SHARE) * np.exp(own.log_probability.astype(float))
    return Bigram(units, np.log(np.maximum(mixed, 1e-9)).astype(np.float32))


def combined_log_likelihoods(
    combined: CombinedPhones, own_features: NDArray[np.float32], own_weight: float, general: NDArray[np.float32]
) -> LogLikelihoods:
    """Return the log likelihoods of a recording under both models: a weighted sum of their log densities.

    own_features : for the own models [shape=(T, 39)]
    own_weight   : of the log densities of the own models, 0 to 1; those of the general ones have weight 1
    general      : features for the general models [shape=(T, 39)]
    """
    model = general_model()
    kept = model.log_density(general) if len(general) <= KEPT_FRAMES else None

    def log_density(first: int, end: int, chosen: DensitySelection) -> NDArray[np.float32]:
        of_general = kept[first:end] if kept is not None else model.log_density(general[first:end])
        values = of_general[:, combined.columns if chosen is None else combined.columns[chosen]]
        if own_weight > 0:
            values += np.float32(own_weight) * combined.hmm.mixtures.log_likelihood(own_features[first:end], chosen)
        return values

    return LogLikelihoods(len(general), log_density)
