"""Known unit models, and utterances drawn from them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lipmotion.hmm import network, unit_training
from lipmotion.hmm.align import align_units, place_words
from lipmotion.hmm.model import HmmConfig, UnitHmm, make_plain_states
from lipmotion.stats.bigram import Bigram, estimate_bigram
from lipmotion.stats.mixture import Mixtures
from oracles.statistics import random_mixtures

SILENCE, PAUSE = "sil", "sp"
INVENTORY = unit_training.UnitInventory(SILENCE, PAUSE, energy=0)
UNITS = ("a", "b", "c", "d", "e")


def random_hmm(
    seed: int, units: Sequence[str] = ("a", "b"), states: int = 3, contexts: int = 0, config: HmmConfig | None = None
) -> UnitHmm:
    """Return models with random densities; some states in context have densities of their own."""
    draw = np.random.default_rng(seed)
    names = (SILENCE, PAUSE, *units)
    table = make_plain_states(names, tuple(1 if unit == PAUSE else states for unit in names), (SILENCE, PAUSE))
    plain = len(table.names)
    possible = sorted(
        {
            table.name(left, unit, right, state)
            for unit in units
            for left in (SILENCE, *units)
            for right in (SILENCE, *units)
            for state in range(states)
            if table.side(unit, state)
        }
    )
    table = replace(table, names=(*table.names, *draw.permutation(possible)[:contexts].tolist()))
    shape = (len(table.names), 2, 2)
    mixtures = random_mixtures(draw, shape, 2.0, 1.5, (0.3, 2))
    bigram = Bigram(names, np.log(draw.dirichlet(np.ones(len(names)), len(names))).astype(np.float32))
    stay = np.log(draw.uniform(0.2, 0.9, plain)).astype(np.float32)
    return UnitHmm(config or HmmConfig(states, bigram_weight=1.3, insertion=-0.4), table, mixtures, stay, bigram)


@dataclass(frozen=True, eq=False)
class Speaker:
    """A speaker of units whose states all have different features: 4 features, the first one the loudness.

    means : [shape=(3, 4)] of the three states of each unit
    """

    means: dict[str, np.ndarray]
    spread: float

    def say(self, draw: np.random.Generator, units: Sequence[str]) -> tuple[np.ndarray, list[int]]:
        """Return features, and the first frame of every unit with the frame count at the end."""
        frames, edges = [], [0]
        for unit in units:
            shortest, longest = (5, 9) if unit == SILENCE else (2, 5)
            lengths = draw.integers(shortest, longest, size=1 if unit == PAUSE else 3)
            sound = self.means[SILENCE if unit == PAUSE else unit]
            if unit == PAUSE:
                lengths = lengths * 4
            for mean, length in zip(sound, lengths, strict=False):
                frames.append(mean + draw.normal(0, self.spread, (length, 4)))
            edges.append(edges[-1] + int(lengths.sum()))
        return np.concatenate(frames).astype(np.float32), edges


def speaker(seed: int = 0, spread: float = 0.4) -> Speaker:
    draw = np.random.default_rng(seed)
    means = {unit: np.c_[np.full(3, 3.0), draw.normal(0, 2.5, (3, 3))] for unit in UNITS}
    means[SILENCE] = np.tile([-3.0, 0.0, 0.0, 0.0], (3, 1))
    return Speaker(means, spread)


def known_hmm(who: Speaker, sentences: Sequence[Sequence[str]] = (), config: HmmConfig | None = None) -> UnitHmm:
    """Return the models from which a speaker's utterances are drawn."""
    names = (SILENCE, PAUSE, *UNITS)
    table = make_plain_states(names, tuple(1 if unit == PAUSE else 3 for unit in names), (SILENCE, PAUSE))
    sounds = [who.means[SILENCE if unit == PAUSE else unit][state] for unit in names for state in range(3)]
    means = np.array([sound for number, sound in enumerate(sounds) if number not in (4, 5)], np.float32)[:, None]
    variances = np.full(means.shape, who.spread**2, np.float32)
    stay = np.full(len(means), np.log(0.7), np.float32)
    mixtures = Mixtures(np.zeros(means.shape[:2], np.float32), means, variances)
    return UnitHmm(config or HmmConfig(mixtures=1), table, mixtures, stay, estimate_bigram(names, sentences))


def sentences(seed: int, count: int, words: int = 4) -> list[tuple[tuple[str, ...], ...]]:
    """Return sentences of random words, each one or two units."""
    draw = np.random.default_rng(seed)
    lexicon = [("a",), ("b", "c"), ("d", "a"), ("e", "b"), ("c", "d"), ("e",)]
    return [tuple(lexicon[i] for i in draw.integers(len(lexicon), size=words)) for _ in range(count)]


def within_silence(words: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the units of words, with silence at both ends."""
    return (SILENCE, *(unit for word in words for unit in word), SILENCE)


def align(hmm: UnitHmm, features: np.ndarray, units: Sequence[str]) -> np.ndarray:
    return align_units(hmm, network.compute_log_likelihoods(hmm, features), units)


def decode(hmm: UnitHmm, features: np.ndarray, inventory: Sequence[str]) -> tuple[tuple[str, ...], np.ndarray]:
    loop = network.build_unit_loop(hmm, inventory)
    return network.decode_path(loop, loop.network.best_path(network.compute_log_likelihoods(hmm, features)))


def choose(hmm: UnitHmm, features: np.ndarray, words: Sequence[Sequence[Sequence[str]]]):
    placed = place_words(hmm, network.compute_log_likelihoods(hmm, features), words, PAUSE)
    return [item.spoken for item in placed]


def recordings(seed: int, count: int, who: Speaker, pauses: bool = False):
    """Return utterances with their transcripts, the units spoken in each, and their first frames."""
    draw = np.random.default_rng([seed, 3])
    transcribed, said, edges = [], [], []
    for number, words in enumerate(sentences(seed, count)):
        units = [SILENCE]
        for position, word in enumerate(words):
            units += [PAUSE] * (pauses and number % 2 == 0 and position == 2)
            units += word
        features, where = who.say(draw, [*units, SILENCE])
        transcribed.append(unit_training.TranscribedUtterance(features, tuple((word,) for word in words)))
        said.append((*units, SILENCE))
        edges.append(where)
    return transcribed, said, edges
