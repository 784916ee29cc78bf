"""The general models: English phone models of many voices and a bigram of pocketsphinx."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.hmm.model import StateTable, UnitHmm
from lipmotion.hmm.network import DensitySelection, LogLikelihoods
from lipmotion.stats.bigram import Bigram
from lipmotion.stats.mixture import Mixtures
from lipmotion.units import PHONES as INVENTORY
from lipmotion.units import SILENCE, find_similar_phone, is_silent
from lipmotion.units.lexicon import find_english_data

PHONES = (
    "+NSN+ +SPN+ AA AE AH AO AW AY B CH D DH EH ER EY F G HH IH IY JH K L M N NG OW OY P R S SH SIL T TH UH UW V W Y Z"
    " ZH"
).split()
"""Names in the order of the files; the first two are noise and noise of the mouth."""
STATES = 3
STREAMS = (slice(0, 13), slice(13, 26), slice(26, 39))  # cepstra, Δ and ΔΔ have separate codebooks
GAUSSIANS = 128
WEIGHT_STEP = 1024 * float(np.log(1.0001))
"""Step of the negative logarithms by which the mixture weights are stored, as bytes."""
BLOCK = 128  # frames computed at a time: the values of their 5,376 Gaussians fit into the cache
THREADS = 2  # threads that compute blocks: NumPy lets them run at the same time
MIN_VARIANCE = 1e-4


@dataclass(frozen=True, eq=False)
class GeneralModel:
    """Phone-tied mixtures: every phone has 128 Gaussians a stream, every state its own mixture weights."""

    forms: tuple[NDArray[np.float32], ...]  # coefficients of x and x² in log densities [each shape=(26, P·128)]
    constants: tuple[NDArray[np.float32], ...]  # of these log densities [each shape=(P·128,)]
    weights: tuple[NDArray[np.float32], ...]  # mixture weights of the states [each shape=(P, 128, 3)]

    def log_density(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the log density of every frame under every state, less that of the best state [shape=(T, P·3)].

        features : from ``general_features`` [shape=(T, 39)]
        """
        result = np.empty((len(features), len(PHONES) * STATES), np.float32)

        def fill(start: int) -> None:
            frames = features[start : start + BLOCK]
            total = np.zeros((len(frames), result.shape[1]), np.float32)
            for number, stream in enumerate(STREAMS):
                total += self._stream(number, frames[:, stream])
            np.subtract(total, total.max(axis=1, keepdims=True), out=result[start : start + BLOCK])

        with ThreadPoolExecutor(THREADS) as threads:
            list(threads.map(fill, range(0, len(features), BLOCK)))
        return result

    def mixtures(self, stream: int) -> Mixtures:
        """Return the densities of all states in one stream [G = P·3, M = 128, D = 13]."""
        pulls, halves = self.forms[stream].reshape(2, -1, len(PHONES), GAUSSIANS).transpose(0, 2, 3, 1)
        means, variances = (np.repeat(values, STATES, axis=0) for values in (pulls / (-2 * halves), 1 / (-2 * halves)))
        weights = self.weights[stream].transpose(0, 2, 1).reshape(-1, GAUSSIANS)
        return Mixtures(np.log(np.maximum(weights, np.float32(1e-30))), means, variances)

    def _stream(self, number: int, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the log densities of frames in one stream [shape=(n, P·3)]."""
        logs = np.concatenate([x, x * x], axis=1) @ self.forms[number]
        logs += self.constants[number]  # in place, here and below: new arrays of this size cost more than the sums
        logs = logs.reshape(len(x), len(PHONES), GAUSSIANS)
        best = logs.max(axis=2, keepdims=True)
        logs -= best
        np.exp(logs, out=logs)
        mixed = np.matmul(logs.transpose(1, 0, 2), self.weights[number]).transpose(1, 0, 2)
        return (np.log(np.maximum(mixed, np.float32(1e-30))) + best).reshape(len(x), -1)


def find_density(phone: str, state: int, states: int) -> int:
    """Return the column of ``log_density`` for a state of a phone.

    phone  : of our inventory, or one of the two noises
    state  : from 0
    states : how many states our model of the phone has; where it is not 3, the general state at the same share is used
    """
    first = PHONES.index(GENERAL_PHONE_NAMES.get(phone, phone.upper())) * STATES
    return first + (2 * state + 1) * STATES // (2 * states)


GENERAL_PHONE_NAMES = {"ax": "AH", "axr": "ER", "ix": "IH", "el": "L", "em": "M", "en": "N", "sp": "SIL"}


@cache
def load_general() -> GeneralModel:
    """Return the models; they are read once. Raises MissingDependencyError: not installed, or of another version."""
    folder = find_english_data() / "en-us"
    try:
        means, variances = (_read_gaussians((folder / name).read_bytes()) for name in ("means", "variances"))
        weights = _read_weights((folder / "sendump").read_bytes())
    except (OSError, ValueError) as error:
        message = f"pocketsphinx's models are not those of its version 5 ({error}): pip install 'pocketsphinx>=5.0.4'"
        raise MissingDependencyError(message) from error
    forms, constants = [], []
    for stream in STREAMS:
        mean, precision = means[:, stream], 1 / np.maximum(variances[:, stream], MIN_VARIANCE)
        form = np.concatenate([mean * precision, precision / -2], axis=1).transpose(1, 0, 2)
        forms.append(np.ascontiguousarray(form.reshape(len(form), -1), np.float32))
        log_norm = mean.shape[1] * np.log(2 * np.pi) - np.log(precision).sum(axis=1) + (mean**2 * precision).sum(axis=1)
        constants.append((log_norm / -2).reshape(-1).astype(np.float32))
    return GeneralModel(tuple(forms), tuple(constants), weights)


def _read_gaussians(content: bytes) -> NDArray[np.float64]:
    """Return means or variances [shape=(phones, 39, 128)] of a file in Sphinx's format."""
    numbers = content[content.index(b"endhdr\n") + len(b"endhdr\n") :]
    expected = np.array([0x11223344, len(PHONES), len(STREAMS), GAUSSIANS, 13, 13, 13], "<i4").tobytes()
    if not numbers.startswith(expected):
        raise ValueError("an unexpected header")
    values = np.frombuffer(numbers, "<f4", offset=len(expected) + 4, count=len(PHONES) * GAUSSIANS * 39)
    by_phone = values.astype(float).reshape(len(PHONES), len(STREAMS), GAUSSIANS, 13)
    return by_phone.transpose(0, 1, 3, 2).reshape(len(PHONES), 39, GAUSSIANS)


def _read_weights(content: bytes) -> tuple[NDArray[np.float32], ...]:
    """Return the mixture weights of the states without context, which come first [each shape=(phones, 128, 3)]."""
    position = 0
    while length := int.from_bytes(content[position : position + 4], "little"):
        position += 4 + length
    gaussians, states = np.frombuffer(content, "<i4", 2, position + 4)
    steps = np.frombuffer(content, np.uint8, offset=position + 12)
    if gaussians != GAUSSIANS or len(steps) != len(STREAMS) * gaussians * states:
        raise ValueError("unexpected weights")
    first = steps.reshape(len(STREAMS), gaussians, states)[:, :, : len(PHONES) * STATES]
    weights = np.exp(first.astype(float) * -WEIGHT_STEP).reshape(len(STREAMS), gaussians, len(PHONES), STATES)
    return tuple(np.ascontiguousarray(weights.transpose(0, 2, 1, 3), np.float32))


PROBABILITY_SHARE = {
    "ah": 0.3, "ax": 0.7, "er": 0.4, "axr": 0.6, "ih": 0.55, "ix": 0.45,
    "l": 0.93, "el": 0.07, "m": 0.99, "em": 0.01, "n": 0.96, "en": 0.04, "sp": 1e-4, "+nsn+": 0.05, "+spn+": 0.05,
}  # fmt: skip
"""The share of each of our phones in the probability of the general phone that it is a form of; all others: 1."""


def load_bigram(units: Sequence[str]) -> NDArray[np.float64]:
    """Return P(next | unit) among some of our phones and the noises [shape=(V, V)]; the noises count as silence.

    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    spelt = ["SIL" if unit.startswith("+") else GENERAL_PHONE_NAMES.get(unit, unit.upper()) for unit in units]
    rows = [PHONES[2:].index(name) for name in spelt]
    pairs = _read_bigram()[np.ix_(rows, rows)] * np.array([PROBABILITY_SHARE.get(unit, 1.0) for unit in units])
    return pairs / pairs.sum(axis=1, keepdims=True)


@cache
def _read_bigram() -> NDArray[np.float64]:
    """Return P(next | phone) of the phone language model that comes with pocketsphinx, without the noises."""
    try:
        from pocketsphinx import Config, LogMath, NGramModel
    except ImportError as error:
        message = "the phone language model comes with pocketsphinx: pip install pocketsphinx"
        raise MissingDependencyError(message) from error
    log_math = LogMath()
    model = NGramModel(Config(), log_math, str(find_english_data() / "en-us-phone.lm.bin"))
    pairs = [[log_math.exp(model.prob([following, phone])) for following in PHONES[2:]] for phone in PHONES[2:]]
    return np.array(pairs)


NOISES = ("+nsn+", "+spn+")
"""Units that only the general models have: noise, and noise of the mouth (a breath, a cough)."""
ENGLISH_SHARE = 0.5  # weight of the English bigram; the rest is the weight of the bigram of the own corpus
BIGRAM_WEIGHT, INSERTION_SCORE = 3.0, -4.0
MAX_CACHED_FRAMES = 400_000
"""The general log densities of a recording of up to so many frames, about an hour, are cached: they are needed twice
and take 500 bytes a frame. Those of a longer recording are computed twice."""


class CombinedPhones(NamedTuple):
    """Models of every phone of the inventory and of the noises."""

    hmm: UnitHmm  # the own models; a phone without one borrows that of the most similar one (``units.SIMILAR_PHONES``)
    columns: NDArray[np.intp]  # the general density that goes with each of its densities [shape=(G,)]


def combine_phones(own: UnitHmm) -> CombinedPhones:
    """Return the own models extended to all phones. Raises MissingDependencyError: pocketsphinx is not installed."""
    old, modelled = own.table, [unit for unit in own.table.units if not is_silent(unit)]
    new = tuple(unit for unit in (*INVENTORY, *NOISES) if unit not in old.units)
    borrowed = [SILENCE if unit in NOISES or is_silent(unit) else find_similar_phone(unit, modelled) for unit in new]
    plain = len(own.log_stay)
    added = {f"{unit}.{state}": old.density(source, state) for unit, source in zip(new, borrowed, strict=True)
             for state in range(old.count(source))}  # fmt: skip
    table = StateTable(
        units=old.units + new,
        counts=old.counts + tuple(old.count(source) for source in borrowed),
        names=(*old.names[:plain], *added, *old.names[plain:]),
        free=(*old.free, *(unit for unit in new if unit in NOISES or is_silent(unit))),
    )
    sources = np.array([*range(plain), *added.values(), *range(plain, len(old.names))], np.intp)
    english = load_bigram(table.units)
    mixed, count = english.copy(), len(own.bigram.units)
    mixed[:count] *= ENGLISH_SHARE
    mixed[:count, :count] += (1 - ENGLISH_SHARE) * np.exp(own.bigram.log_probability.astype(float))
    hmm = replace(
        own,
        config=replace(own.config, bigram_weight=BIGRAM_WEIGHT, insertion=INSERTION_SCORE),
        table=table,
        mixtures=own.mixtures.select(sources),
        log_stay=own.log_stay[sources[: plain + len(added)]],
        bigram=Bigram(table.units, np.log(np.maximum(mixed, 1e-9)).astype(np.float32)),
    )
    columns = []
    for unit, _, rest in (name.partition(".") for name in table.names):
        state = int(rest.partition("<")[0].partition(">")[0])
        columns.append(find_density(unit, state, table.count(unit)))
    return CombinedPhones(hmm, np.array(columns, np.intp))


def combine_likelihoods(
    combined: CombinedPhones, own_features: NDArray[np.float32], own_weight: float, general: NDArray[np.float32]
) -> LogLikelihoods:
    """Return the log likelihoods of a recording under both models: a weighted sum of their log densities.

    own_features : for the own models [shape=(T, 39)]
    own_weight   : of the log densities of the own models, 0 to 1; those of the general ones have weight 1
    general      : features for the general models [shape=(T, 39)]
    """
    model = load_general()
    cached = model.log_density(general) if len(general) <= MAX_CACHED_FRAMES else None

    def log_density(first: int, end: int, chosen: DensitySelection) -> NDArray[np.float32]:
        of_general = cached[first:end] if cached is not None else model.log_density(general[first:end])
        values = of_general[:, combined.columns if chosen is None else combined.columns[chosen]]
        if own_weight > 0:
            values += np.float32(own_weight) * combined.hmm.mixtures.log_likelihood(own_features[first:end], chosen)
        return values

    return LogLikelihoods(len(general), log_density)
