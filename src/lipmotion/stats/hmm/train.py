"""Embedded training from transcripts without unit labels: flat start, plain units, mixtures, contexts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.kernels.forward_backward import IMPOSSIBLE, chain_posteriors
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.em import Monitor
from lipmotion.stats.hmm.align import Chain, chain_of, choose_pronunciations, state_path
from lipmotion.stats.hmm.evidence import heard
from lipmotion.stats.hmm.loudness import loud_frames
from lipmotion.stats.hmm.model import HmmConfig, UnitHmm
from lipmotion.stats.hmm.states import StateTable, plain_states
from lipmotion.stats.mixture import Mixtures, single_gaussian

CELLS = 2_000_000
"""Frames × utterances × states whose posteriors are computed together: 16 MB an array, some hundred in all."""
LEAST_POSTERIOR = 1e-3
"""State posteriors under this are left out of the statistics."""
ONSET_FRAMES = 21
"""For the flat start, speech is where the energy is loud, averaged over so many frames. Without averaging a click or
a breath is the end of speech, and the state before it takes the silence for its own: the last words of GRID then
ended up to 0.8 s late."""
LONGEST_SILENCE, LONGEST_STATE = 200.0, 12.0
"""Most frames that a state of silence, or of any other unit, may last on average. Without the second limit the
closure of a stop that begins every other sentence takes the silence before it for its own."""


@dataclass(frozen=True, eq=False)
class Transcribed:
    """Features [shape=(T, D)] and, for each word said, its possible pronunciations."""

    features: NDArray[np.float32]
    words: tuple[tuple[tuple[str, ...], ...], ...]


@dataclass(frozen=True)
class UnitInventory:
    """The units to model. ``silence`` surrounds every utterance, ``pause`` may stand between words.

    energy : the column of the features that holds the log energy
    """

    silence: str
    pause: str
    energy: int


def train_hmm(
    utterances: Sequence[Transcribed], inventory: UnitInventory, config: HmmConfig, monitor: Monitor
) -> UnitHmm:
    """Train models of every unit that the utterances say.

    Stages: flat start with the first pronunciations; choice of pronunciations and pauses; mixtures by
    splitting; the choice again; states in context. Each stage is embedded Baum–Welch over whole utterances.
    Raises CorpusError: no utterance, or none long enough for its transcript.
    """
    sequences = [_first_guess(u, inventory) for u in utterances]
    kept = [i for i, (u, s) in enumerate(zip(utterances, sequences, strict=True)) if _fits(u, s, config)]
    if not kept:
        raise CorpusError(
            f"none of {len(utterances)} utterances has a transcript that fits into its recording; "
            "check that transcripts and recordings belong together"
        )
    data = [utterances[i].features for i in kept]
    hmm = _flat_start(data, [sequences[i] for i in kept], inventory, config)
    hmm = _iterate(hmm, data, [sequences[i] for i in kept], monitor, "flat start", 2 * config.iterations)
    hmm = _with_pause(hmm, inventory)
    said = [_pronounced(hmm, utterances[i], sequences[i], inventory) for i in kept]
    hmm = _iterate(hmm, data, said, monitor, "pronunciations", config.iterations)
    while hmm.mixtures.size[1] < config.mixtures:
        hmm = replace(hmm, mixtures=hmm.mixtures.split())
        hmm = _iterate(hmm, data, said, monitor, f"{hmm.mixtures.size[1]} Gaussians", config.iterations)
    said = [_pronounced(hmm, utterances[i], s, inventory) for i, s in zip(kept, said, strict=True)]
    hmm = _iterate(hmm, data, said, monitor, "pronunciations again", config.iterations)
    hmm = replace(hmm, bigram=estimate_bigram(hmm.table.units, [_without_pauses(s, inventory) for s in said]))
    hmm = replace(hmm, typical_fit=float(np.mean([hmm.fit(x) for x in data])))
    return _in_context(hmm, data, said, monitor)


def _first_guess(utterance: Transcribed, inventory: UnitInventory) -> tuple[str, ...]:
    spoken = [unit for word in utterance.words for unit in word[0]]
    return (inventory.silence, *spoken, inventory.silence)


def _fits(utterance: Transcribed, sequence: Sequence[str], config: HmmConfig) -> bool:
    return len(utterance.features) >= config.states * len(sequence)


def _without_pauses(sequence: Sequence[str], inventory: UnitInventory) -> tuple[str, ...]:
    return tuple(inventory.silence if unit == inventory.pause else unit for unit in sequence)


def _with_pause(hmm: UnitHmm, inventory: UnitInventory) -> UnitHmm:
    """Let the pause, which no first guess has, sound like the middle of silence."""
    mixtures, pause = hmm.mixtures.copy(), hmm.table.density(inventory.pause, 0)
    silence = hmm.table.density(inventory.silence, hmm.table.count(inventory.silence) // 2)
    for array in (mixtures.log_weights, mixtures.means, mixtures.variances):
        array[pause] = array[silence]
    return replace(hmm, mixtures=mixtures)


def _pronounced(
    hmm: UnitHmm, utterance: Transcribed, before: tuple[str, ...], inventory: UnitInventory
) -> tuple[str, ...]:
    """Return the units said, pauses included; what was assumed before where they do not fit."""
    known = set(hmm.table.units)
    words = [[v for v in variants if set(v) <= known] or variants[:1] for variants in utterance.words]
    try:
        chosen = choose_pronunciations(hmm, heard(hmm, utterance.features), words, inventory.pause)
    except AlignmentError:
        return before
    sequence = tuple(unit for said in chosen for unit in said.units)
    states = sum(hmm.table.count(unit) for unit in sequence)
    return sequence if states <= len(utterance.features) else before


def _flat_start(
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    inventory: UnitInventory,
    config: HmmConfig,
) -> UnitHmm:
    silence_and_pause = (inventory.silence, inventory.pause)
    units = (*silence_and_pause, *sorted({u for s in sequences for u in s} - {inventory.silence}))
    counts = tuple(1 if unit == inventory.pause else config.states for unit in units)
    table = plain_states(units, counts, free=silence_and_pause)
    log_stay = np.log(1 - 1 / _longest(table)).astype(np.float32)
    start = single_gaussian(np.concatenate(data), len(table.names))
    hmm = UnitHmm(config, table, start, log_stay, estimate_bigram(units, []))
    statistics = _Statistics(hmm)
    for x, sequence in zip(data, sequences, strict=True):
        chain = chain_of(hmm, sequence)
        posterior = np.zeros((len(x), len(chain.plain)))
        posterior[np.arange(len(x)), _even_path(x[:, inventory.energy], chain, len(sequence))] = 1
        statistics.collect(x, chain, posterior, np.zeros(len(chain.plain)))
    return replace(hmm, mixtures=_maximised(hmm, statistics, data))


def _even_path(energy: NDArray[np.float32], chain: Chain, units: int) -> NDArray[np.intp]:
    """Return a first guess of the state in each frame: silence up to the first and from the last loud frame,
    all other states spread evenly between. [shape=(T,)]
    """
    above = np.nonzero(loud_frames(energy, ONSET_FRAMES))[0]
    onset, offset = (int(above[0]), int(above[-1]) + 1) if len(above) else (0, len(energy))
    silence = int((chain.positions == 0).sum())
    speech = int(((chain.positions > 0) & (chain.positions < units - 1)).sum())
    path = np.empty(len(energy), np.intp)
    path[:onset] = np.arange(onset) * silence // max(onset, 1)
    path[onset:offset] = silence + np.arange(offset - onset) * speech // max(offset - onset, 1)
    tail = len(energy) - offset
    path[offset:] = silence + speech + np.arange(tail) * (len(chain.plain) - silence - speech) // max(tail, 1)
    return path


def _iterate(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    monitor: Monitor,
    stage: str,
    iterations: int,
) -> UnitHmm:
    for _ in range(iterations):
        hmm, log_likelihood = baum_welch(hmm, data, sequences)
        monitor(stage, log_likelihood)
    return hmm


def baum_welch(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]]
) -> tuple[UnitHmm, float]:
    """Take one embedded Baum–Welch step.

    data      : features of every utterance [shape=(T, D)]
    sequences : the units said in each
    Returns the new models, and the mean log likelihood per frame under the old ones.
    An utterance too short for its units is left out.
    """
    statistics = expect(hmm, data, sequences)
    better = replace(hmm, mixtures=_maximised(hmm, statistics, data), log_stay=statistics.log_stay())
    return better, statistics.mean_log_likelihood


def _maximised(hmm: UnitHmm, statistics: _Statistics, data: Sequence[NDArray[np.float32]]) -> Mixtures:
    mixtures = hmm.mixtures.copy()
    floor = hmm.config.variance_floor * np.concatenate(data).var(axis=0)
    for density, x, share in statistics.by_density():
        if share.sum() >= 1:
            mixtures.improve(density, x, share, floor)
    return mixtures


def expect(hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]]) -> _Statistics:
    """Return what the utterances say about every state (the E-step)."""
    statistics = _Statistics(hmm)
    chains = [chain_of(hmm, sequence) for sequence in sequences]
    for batch in _batches([len(x) for x in data], [len(chain.plain) for chain in chains]):
        statistics.add([data[i] for i in batch], [chains[i] for i in batch])
    return statistics


def _batches(frames: Sequence[int], states: Sequence[int]) -> Iterator[list[int]]:
    """Give utterances in groups of like length, padded to no more than ``CELLS`` unless one alone is larger."""
    batch: list[int] = []
    most = 0
    for i in sorted(range(len(frames)), key=lambda i: frames[i]):
        most = max(most, states[i])
        if batch and frames[i] * most * (len(batch) + 1) > CELLS:
            yield batch
            batch, most = [], states[i]
        batch.append(i)
    if batch:
        yield batch


class _Statistics:
    """What one pass over the data says about every state."""

    def __init__(self, hmm: UnitHmm) -> None:
        self._hmm = hmm
        self._log_likelihood, self._frames = 0.0, 0
        self._stay = np.zeros(len(hmm.log_stay))
        self._occupied = np.zeros(len(hmm.log_stay))
        self._densities: list[NDArray[np.intp]] = []
        self._shares: list[NDArray[np.float32]] = []
        self._rows: list[NDArray[np.intp]] = []
        self._features: list[NDArray[np.float32]] = []
        self._seen = 0

    @property
    def mean_log_likelihood(self) -> float:
        """Per frame."""
        return self._log_likelihood / max(self._frames, 1)

    def add(self, data: list[NDArray[np.float32]], chains: list[Chain]) -> None:
        """Add some utterances."""
        frames = np.array([len(x) for x in data], np.intp)
        states = np.array([len(chain.densities) for chain in chains], np.intp)
        log_emission = np.zeros((frames.max(), len(data), states.max()))
        log_stay = np.full((len(data), states.max()), -1.0)
        for u, (x, chain) in enumerate(zip(data, chains, strict=True)):
            used, local = np.unique(chain.densities, return_inverse=True)
            log_emission[: len(x), u, : states[u]] = self._hmm.mixtures.log_likelihood(x, used)[:, local]
            log_stay[u, : states[u]] = self._hmm.log_stay[chain.plain]
        log_move = np.log(-np.expm1(log_stay))
        posterior, stay, log_likelihood = chain_posteriors(log_emission, log_stay, log_move, frames, states)
        for u, (x, chain) in enumerate(zip(data, chains, strict=True)):
            self.collect(x, chain, posterior[: len(x), u, : states[u]], stay[u, : states[u]])
        possible = log_likelihood > IMPOSSIBLE / 2
        self._log_likelihood += float(log_likelihood[possible].sum())
        self._frames += int(frames[possible].sum())

    def collect(
        self, x: NDArray[np.float32], chain: Chain, posterior: NDArray[np.float64], stay: NDArray[np.float64]
    ) -> None:
        """Add one utterance whose posteriors are known."""
        np.add.at(self._stay, chain.plain, stay)
        np.add.at(self._occupied, chain.plain, posterior.sum(axis=0))
        frame, state = np.nonzero(posterior > LEAST_POSTERIOR)
        self._densities.append(chain.densities[state])
        self._shares.append(posterior[frame, state].astype(np.float32))
        self._rows.append(frame + self._seen)
        self._features.append(x)
        self._seen += len(x)

    def by_density(self) -> Iterator[tuple[int, NDArray[np.float32], NDArray[np.float32]]]:
        """Give every density that was visited: its number, the frames, and its posterior in each."""
        densities, shares = np.concatenate(self._densities), np.concatenate(self._shares)
        rows, features = np.concatenate(self._rows), np.concatenate(self._features)
        order = np.argsort(densities, kind="stable")
        visited, starts = np.unique(densities[order], return_index=True)
        for density, mine in zip(visited, np.split(order, starts[1:]), strict=True):
            yield int(density), features[rows[mine]], shares[mine]

    def log_stay(self) -> NDArray[np.float32]:
        """Return log P(keep the state) of every state without context."""
        kept = self._stay / np.maximum(self._occupied, 1e-9)
        keep = np.where(self._occupied > 0, kept, np.exp(self._hmm.log_stay))
        return np.log(np.clip(keep, 0.05, 1 - 1 / _longest(self._hmm.table)[: len(keep)])).astype(np.float32)


def _longest(table: StateTable) -> NDArray[np.float64]:
    """Return the most frames each state may last on average [shape=(G,)]."""
    units = [name.split(".")[0] for name in table.names]
    return np.array([LONGEST_SILENCE if unit in table.free else LONGEST_STATE for unit in units])


def _in_context(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]], monitor: Monitor
) -> UnitHmm:
    """Give states in contexts with enough data densities of their own, adapted from those without context."""
    parents = _frequent_contexts(hmm, data, sequences)
    monitor("states in context", len(parents))
    if not parents:
        return hmm
    plain = len(hmm.table.names)
    prior = np.array(list(parents.values()), np.intp)
    hmm = replace(
        hmm, table=hmm.table.extended(tuple(parents)), mixtures=hmm.mixtures.joined(hmm.mixtures.picked(prior))
    )
    for _ in range(hmm.config.iterations):
        statistics = expect(hmm, data, sequences)
        monitor("contexts", statistics.mean_log_likelihood)
        mixtures = hmm.mixtures.copy()
        for density, x, share in statistics.by_density():
            if density >= plain:
                mixtures.adapt(density, x, share, int(prior[density - plain]), hmm.config.relevance)
        hmm = replace(hmm, mixtures=mixtures)
    return hmm


def _frequent_contexts(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]]
) -> dict[str, int]:
    """Return the names of all states in contexts with enough frames, with the density each one starts from."""
    frames: Counter[tuple[str, int]] = Counter()
    for x, sequence in zip(data, sequences, strict=True):
        if len(x) >= sum(hmm.table.count(unit) for unit in sequence):
            names, path = state_path(hmm, heard(hmm, x), sequence)
            frames.update(names[position] for position in path)
    chosen = {name: plain for (name, plain), count in frames.items() if count >= hmm.config.context_frames}
    return {name: chosen[name] for name in sorted(chosen) if name not in hmm.table.names}
