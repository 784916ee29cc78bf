"""Embedded Baum–Welch training of phone (unit) models from recordings and their words, without labels of phones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.hmm.align import StateSequence, align_states, expand_states, place_words
from lipmotion.hmm.loudness import smooth_level
from lipmotion.hmm.model import HmmConfig, UnitHmm, hmm_from_arrays, hmm_to_arrays, make_plain_states
from lipmotion.hmm.network import compute_log_likelihoods
from lipmotion.kernels.forward_backward import LOG_ZERO, chain_posteriors
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.em import Sums, run_em, sum_statistics
from lipmotion.stats.mixture import Mixtures, with_squares
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Monitor, Progress

CELLS = 1_000_000
"""Frames × utterances × states of a batch whose posteriors are computed together: 8 MB an array, some fifty arrays."""
MIN_STAY_PROBABILITY = 0.05  # smallest probability of staying in a state
MIN_POSTERIOR = 1e-3  # smaller state posteriors are left out of the statistics of densities
LONGEST_SILENCE_FRAMES, LONGEST_STATE_FRAMES = 200.0, 12.0
"""Largest mean duration, in frames, of a state of silence, and of a state of any other unit. Without the second limit
the closure of a stop that begins every other sentence absorbs the silence before it."""
Maximise = Callable[[UnitHmm, "UnitStatistics"], UnitHmm]


def reestimate_states(model: UnitHmm, statistics: UnitStatistics) -> UnitHmm:
    """Return models with all densities, and the durations of all states, re-estimated from statistics (M-step).

    A state without data keeps its probability of staying; all are limited by the largest mean durations.
    """
    measured = statistics.stay / np.maximum(statistics.occupied, 1e-9)
    stay = np.where(statistics.occupied > 0, measured, np.exp(model.log_stay))
    longest = limit_stay(np.repeat(model.table.units, model.table.counts), model.table.free)
    log_stay = np.log(np.clip(stay, MIN_STAY_PROBABILITY, longest)).astype(np.float32)
    return replace(model, mixtures=reestimate_mixtures(model, statistics), log_stay=log_stay)


def adapt_contexts(model: UnitHmm, statistics: UnitStatistics) -> UnitHmm:
    """Return models whose states in context are adapted (M-step), with those without, which stay, as their prior."""
    plain, parents = len(model.log_stay), model.table.parents()
    mixtures = model.mixtures.copy()
    for density in plain + np.flatnonzero(statistics.frames_of_densities[plain:]):
        sums = statistics.components[density]
        mixtures.map_update(int(density), sums, int(parents[density]), model.config.relevance)
    return replace(model, mixtures=mixtures)


def reestimate_mixtures(hmm: UnitHmm, statistics: UnitStatistics) -> Mixtures:
    """Return the densities re-estimated (M-step); with less than one frame of data they stay."""
    mixtures = hmm.mixtures.copy()
    enough = np.flatnonzero(statistics.frames_of_densities >= 1)
    mean, square = np.split(statistics.features[:-1] / statistics.features[-1], 2)
    floor = hmm.config.variance_floor * np.maximum(square - mean * mean, 0.0)
    mixtures.set_from_statistics(enough, statistics.components[enough], floor)
    return mixtures


def accumulate_statistics(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    work: Checkpoint = NO_CHECKPOINT,
) -> UnitStatistics:
    """Return the sufficient statistics of utterances for every state (the E-step of embedded Baum–Welch).

    data      : features of every utterance [shape=(T, D)]
    sequences : the units spoken in each; an utterance too short for its units is left out
    work      : as of ``sum_statistics``
    """
    states = [sum(hmm.table.count(unit) for unit in sequence) for sequence in sequences]
    batches = group_by_length([len(x) for x in data], states)
    shards = [([data[i] for i in batch], [sequences[i] for i in batch]) for batch in batches]
    return UnitStatistics(**sum_statistics(_shard_sums, hmm, shards, work))


def _shard_sums(job: tuple[UnitHmm, tuple[list[NDArray[np.float32]], list[tuple[str, ...]]]]) -> Sums:
    hmm, (data, sequences) = job
    chains = [expand_states(hmm, sequence) for sequence in sequences]
    log_emissions = []
    for x, chain in zip(data, chains, strict=True):
        used, local = np.unique(chain.densities, return_inverse=True)
        log_emissions.append(hmm.mixtures.log_likelihood(x, used)[:, local])
    posteriors = infer_chains(log_emissions, [hmm.log_stay[chain.plain] for chain in chains])
    log_likelihood = np.array([each.log_likelihood for each in posteriors])
    possible, frames = log_likelihood > LOG_ZERO / 2, np.array([len(x) for x in data])
    total = {"log_likelihood": log_likelihood[possible].sum(), "frames": frames[possible].sum()}
    return {**_add_up(hmm, data, chains, posteriors), **total}


class StatePosteriors(NamedTuple):
    """The posteriors of an utterance's states [shape=(T, S)], and expected transitions to themselves [shape=(S,)]."""

    states: NDArray[np.float64]
    stay: NDArray[np.float64]
    log_likelihood: float


def infer_chains(
    log_emissions: Sequence[NDArray[np.floating]], log_stays: Sequence[NDArray[np.floating]]
) -> list[StatePosteriors]:
    """Return the posteriors of states in a row, for several utterances [each shape=(T, S), (S,)], computed together."""
    frames, states = np.array([each.shape for each in log_emissions], np.intp).T
    log_emission = np.zeros((frames.max(), len(frames), states.max()))
    log_stay = np.full((len(frames), states.max()), -1.0)
    for u, (emission, stay) in enumerate(zip(log_emissions, log_stays, strict=True)):
        log_emission[: frames[u], u, : states[u]], log_stay[u, : states[u]] = emission, stay
    found = chain_posteriors(log_emission, log_stay, np.log(-np.expm1(log_stay)), frames, states)
    return [
        StatePosteriors(posterior[: frames[u], : states[u]], stay[: states[u]], float(log_likelihood))
        for u, (posterior, stay, log_likelihood) in enumerate(zip(found[0].transpose(1, 0, 2), *found[1:], strict=True))
    ]


def _add_up(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    chains: Sequence[StateSequence],
    posteriors: Sequence[StatePosteriors],
) -> Sums:
    """Return the sums of ``UnitStatistics`` over utterances, without their likelihood."""
    stays, occupied = np.zeros((2, len(hmm.log_stay)))
    pairs = []
    for x, chain, (posterior, stay, _) in zip(data, chains, posteriors, strict=True):
        np.add.at(stays, chain.plain, stay)
        np.add.at(occupied, chain.plain, posterior.sum(axis=0))
        frame, state = np.nonzero(posterior > MIN_POSTERIOR)
        pairs.append((x[frame], chain.densities[state], posterior[frame, state].astype(np.float32)))
    rows, densities, weights = (np.concatenate(arrays) for arrays in zip(*pairs, strict=True))
    order = np.argsort(densities, kind="stable")
    visited, starts = np.unique(densities[order], return_index=True)
    G, M, D = hmm.mixtures.size
    components = np.zeros((G, M, 2 * D + 1))
    for density, entries in zip(visited, np.split(order, starts[1:]), strict=False):  # all may be too short
        components[density] = hmm.mixtures.component_sums(int(density), rows[entries], weights[entries])
    features = sum(with_squares(x).sum(axis=0, dtype=float) for x in data)
    return {"stay": stays, "occupied": occupied, "components": components, "features": np.asarray(features)}


def group_by_length(frames: Sequence[int], states: Sequence[int]) -> Iterator[list[int]]:
    """Give the numbers of utterances in batches of similar length, of at most ``CELLS`` cells, or of one utterance."""
    batch: list[int] = []
    max_states = 0
    for i in sorted(range(len(frames)), key=lambda i: frames[i]):
        max_states = max(max_states, states[i])
        if batch and frames[i] * max_states * (len(batch) + 1) > CELLS:
            yield batch
            batch, max_states = [], states[i]
        batch.append(i)
    if batch:
        yield batch


@dataclass(frozen=True, eq=False)
class UnitStatistics:
    """The sufficient statistics of one pass over the data.

    stay, occupied : [shape=(R,)], expected transitions of every state without context to itself, and its frames
    components     : of every density [shape=(G, M, 2 D + 1)], as of ``Mixtures.component_sums``
    features       : of all frames [shape=(2 D + 1,)], alike
    log_likelihood, frames : of the utterances that have a path
    """

    stay: NDArray[np.float64]
    occupied: NDArray[np.float64]
    components: NDArray[np.float64]
    features: NDArray[np.float64]
    log_likelihood: NDArray[np.float64] | float = 0.0
    frames: NDArray[np.intp] | int = 0

    @property
    def mean_log_likelihood(self) -> float:
        """Mean log likelihood per frame."""
        return float(self.log_likelihood) / max(int(self.frames), 1)

    @property
    def frames_of_densities(self) -> NDArray[np.float64]:
        """Expected frames of every density [shape=(G,)]."""
        return self.components[:, :, -1].sum(axis=1)


def limit_stay(units: Iterable[str], free: Collection[str]) -> NDArray[np.float64]:
    """Return the largest probability of staying allowed in states without context, of these units [shape=(R,)]."""
    longest = [LONGEST_SILENCE_FRAMES if unit in free else LONGEST_STATE_FRAMES for unit in units]
    return 1 - 1 / np.array(longest)


_CHECKPOINT = "phones"
UTTERANCES_PER_BLOCK = 32  # utterances whose pronunciations are chosen together, by one worker
ONSET_FRAMES = 21
"""For the flat start, speech is where the energy, averaged over so many frames, is loud. Without averaging a click or
a breath is taken for the end of speech, and the state before it absorbs the silence: the last words of GRID then
ended up to 0.8 s late."""
FRAMES_A_GAUSSIAN = 25
"""Mixtures are split while on average so many frames are left for each Gaussian. With 20 clips of GRID, 2 instead of 8
Gaussians raise ACC of opening on the validation list from 0.753 to 0.767, audio only; with 50, 4 raise it from 0.840 to
0.855."""


@dataclass(frozen=True, eq=False)
class TranscribedUtterance:
    """Features of an utterance [shape=(T, D)] and, for each word of its transcript, its possible pronunciations."""

    features: NDArray[np.float32]
    words: tuple[tuple[tuple[str, ...], ...], ...]


@dataclass(frozen=True)
class UnitInventory:
    """The units to model: ``silence`` surrounds every utterance, ``pause`` may stand between words."""

    silence: str
    pause: str
    energy: int


def train_hmm(
    utterances: Sequence[TranscribedUtterance],
    inventory: UnitInventory,
    config: HmmConfig,
    monitor: Monitor,
    checkpoint: Checkpoint = NO_CHECKPOINT,
) -> UnitHmm:
    """Return models of all units in the transcripts.

    Stages: flat start with the first pronunciations; choice of pronunciations and pauses; mixtures by
    splitting; the choice again; states in context. Each stage is embedded Baum–Welch over whole utterances.
    checkpoint : stores after every step all that the next one needs, and distributes the work
    Raises CorpusError: no utterance, or none long enough for its transcript.
    """
    usable, sequences = [], []
    for utterance in utterances:
        spoken = [unit for word in utterance.words for unit in word[0]]  # the first pronunciation of every word
        sequence = (inventory.silence, *spoken, inventory.silence)
        if len(utterance.features) >= config.states * len(sequence):
            usable.append(utterance)
            sequences.append(sequence)
    if not usable:
        raise CorpusError(
            f"none of {len(utterances)} utterances has a transcript that fits into its recording; check that they match"
        )
    return _Training(usable, sequences, inventory, config, monitor, checkpoint).run()


class _Stage(NamedTuple):
    """One stage of training; ``prepare``: one step before those of EM, which returns a figure for the monitor."""

    name: str
    prepare: Callable[[], float | None] | None
    maximise: Maximise
    em_steps: int

    @property
    def steps(self) -> int:
        """How many steps there are in all."""
        return (self.prepare is not None) + self.em_steps


class _Training:
    """The stages of training over the same utterances: the models, the unit sequences assumed, the steps done."""

    def __init__(
        self,
        utterances: Sequence[TranscribedUtterance],
        sequences: Sequence[tuple[str, ...]],
        inventory: UnitInventory,
        config: HmmConfig,
        monitor: Monitor,
        checkpoint: Checkpoint,
    ) -> None:
        self._utterances, self._inventory = utterances, inventory
        self._monitor, self._checkpoint = monitor, checkpoint
        self._data = [utterance.features for utterance in utterances]
        arrays = checkpoint.load(_CHECKPOINT)
        if arrays is None:
            self._done, self._sequences = 0, list(sequences)
            self._hmm = _make_flat_start(self._data, sequences, inventory, config)
        else:
            self._done, self._sequences = int(arrays["done"]), [tuple(s.split()) for s in arrays["said"].tolist()]
            stored = {name: array for name, array in arrays.items() if name not in ("done", "said")}
            self._hmm = hmm_from_arrays(stored, config)
        steps = config.iterations
        stages = [
            _Stage("flat start", None, reestimate_states, 2 * steps),
            _Stage("pronunciations", self._add_pause, reestimate_states, steps),
        ]
        count, frames = 1, sum(map(len, self._data))
        units = {unit for utterance in self._utterances for word in utterance.words for unit in word[0]}
        while count < config.mixtures and frames >= 2 * count * FRAMES_A_GAUSSIAN * config.states * len(units):
            count *= 2
            stages.append(_Stage(f"{count} Gaussians", self._split, reestimate_states, steps))
        self._stages = [
            *stages,
            _Stage("pronunciations again", self._choose_pronunciations, reestimate_states, steps),
            _Stage("states in context", self._add_contexts, adapt_contexts, 0),
            _Stage("contexts", None, adapt_contexts, steps),
        ]
        self._total = sum(stage.steps for stage in self._stages)

    def run(self) -> UnitHmm:
        """Take all steps that are not done yet; return the models."""
        first = 0
        for stage in self._stages:
            if self._done < first + stage.steps:
                self._monitor(Progress(stage.name, self._done, self._total, self._done / self._total))
                if stage.prepare is not None and self._done == first:
                    self._report(stage, stage.prepare())
                self._run_em(stage, first + stage.steps - self._done)
            first += stage.steps
        return self._hmm

    def _run_em(self, stage: _Stage, steps: int) -> None:
        if stage.maximise is adapt_contexts and len(self._hmm.table.names) == len(self._hmm.log_stay):
            for _ in range(steps):  # there are no states in context
                self._report(stage, None)
        elif steps:

            def after_step(_: int, hmm: UnitHmm, statistics: UnitStatistics) -> None:
                self._hmm = hmm
                self._report(stage, statistics.mean_log_likelihood)

            known = self._data, self._sequences, self._checkpoint
            run_em(self._hmm, lambda hmm: accumulate_statistics(hmm, *known), stage.maximise, steps, after_step)

    def _report(self, stage: _Stage, figure: float | None) -> None:
        self._done += 1
        sequences = np.array([" ".join(units) for units in self._sequences])
        progress = {"said": sequences, "done": np.array(self._done)}
        self._checkpoint.save(_CHECKPOINT, {**hmm_to_arrays(self._hmm, np.float32), **progress})
        self._monitor(Progress(stage.name, self._done, self._total, self._done / self._total, figure))

    def _add_pause(self) -> None:
        """Give the pause the density of the middle of silence, as no first guess contains a pause; then choose."""
        mixtures, table = self._hmm.mixtures.copy(), self._hmm.table
        pause = table.density(self._inventory.pause, 0)
        silence = table.density(self._inventory.silence, table.count(self._inventory.silence) // 2)
        for array in (mixtures.log_weights, mixtures.means, mixtures.variances):
            array[pause] = array[silence]
        self._hmm = replace(self._hmm, mixtures=mixtures)
        self._choose_pronunciations()

    def _choose_pronunciations(self) -> None:
        starts = range(0, len(self._data), UTTERANCES_PER_BLOCK)
        blocks = (slice(start, start + UTTERANCES_PER_BLOCK) for start in starts)
        jobs = ((self._hmm, self._utterances[block], self._sequences[block]) for block in blocks)
        chosen = self._checkpoint.parallel_map(partial(_choose_sequences, pause=self._inventory.pause), jobs)
        self._sequences = [units for sequences in chosen for units in sequences]

    def _split(self) -> None:
        self._hmm = replace(self._hmm, mixtures=self._hmm.mixtures.split())

    def _add_contexts(self) -> float:
        silence, pause = self._inventory.silence, self._inventory.pause
        spoken = [tuple(silence if unit == pause else unit for unit in units) for units in self._sequences]
        typical_fit = float(np.mean([self._hmm.fit(x) for x in self._data]))
        bigram = estimate_bigram(self._hmm.table.units, spoken)
        hmm = replace(self._hmm, bigram=bigram, typical_fit=typical_fit)
        self._hmm = add_contexts(hmm, self._data, self._sequences)
        return len(self._hmm.table.names) - len(self._hmm.log_stay)


def _choose_sequences(
    job: tuple[UnitHmm, Sequence[TranscribedUtterance], Sequence[tuple[str, ...]]], pause: str
) -> list[tuple[str, ...]]:
    """Return the most probable unit sequences, pauses included; those assumed before where they do not fit."""
    hmm, utterances, before = job
    known, sequences = set(hmm.table.units), list(before)
    for number, utterance in enumerate(utterances):
        words = [[v for v in variants if set(v) <= known] or variants[:1] for variants in utterance.words]
        try:
            placed = place_words(hmm, compute_log_likelihoods(hmm, utterance.features), words, pause)
        except AlignmentError:
            continue
        sequence = tuple(unit for item in placed for unit in item.spoken.units)
        if sum(hmm.table.count(unit) for unit in sequence) <= len(utterance.features):
            sequences[number] = sequence
    return sequences


def _make_flat_start(
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    inventory: UnitInventory,
    config: HmmConfig,
) -> UnitHmm:
    """Return models of single Gaussians, from first guesses of the units and of the state in each frame."""
    silence_and_pause = (inventory.silence, inventory.pause)
    units = (*silence_and_pause, *sorted({u for s in sequences for u in s} - {inventory.silence}))
    counts = tuple(1 if unit == inventory.pause else config.states for unit in units)
    table = make_plain_states(units, counts, free=silence_and_pause)
    log_stay = np.log(limit_stay(np.repeat(units, counts), table.free)).astype(np.float32)
    everything, count = np.concatenate(data), len(table.names)
    means, variances = (
        np.tile(values, (count, 1, 1)).astype(np.float32)
        for values in (everything.mean(axis=0), np.maximum(everything.var(axis=0), 1e-4))
    )
    start = Mixtures(np.zeros((count, 1), np.float32), means, variances)
    hmm = UnitHmm(config, table, start, log_stay, estimate_bigram(units, []))
    chains, posteriors = [expand_states(hmm, sequence) for sequence in sequences], []
    for x, sequence, chain in zip(data, sequences, chains, strict=True):
        posterior = np.zeros((len(x), len(chain.plain)))
        energy = x[:, inventory.energy]
        # silence lasts up to the first loud frame, and from the last one; the other states divide the rest evenly
        above = np.nonzero(smooth_level(energy, ONSET_FRAMES) > 0)[0]
        onset, offset = (int(above[0]), int(above[-1]) + 1) if len(above) else (0, len(energy))
        silence = int((chain.positions == 0).sum())
        speech = int(((chain.positions > 0) & (chain.positions < len(sequence) - 1)).sum())
        path = np.empty(len(energy), np.intp)
        path[:onset] = np.arange(onset) * silence // max(onset, 1)
        path[onset:offset] = silence + np.arange(offset - onset) * speech // max(offset - onset, 1)
        tail = len(energy) - offset
        path[offset:] = silence + speech + np.arange(tail) * (len(chain.plain) - silence - speech) // max(tail, 1)
        posterior[np.arange(len(x)), path] = 1
        posteriors.append(StatePosteriors(posterior, np.zeros(len(chain.plain)), 0.0))
    return replace(hmm, mixtures=reestimate_mixtures(hmm, UnitStatistics(**_add_up(hmm, data, chains, posteriors))))


def add_contexts(hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]]) -> UnitHmm:
    """Return models with densities, at first copies, for states in context with enough frames in an alignment."""
    frames: Counter[str] = Counter()
    for x, sequence in zip(data, sequences, strict=True):
        if len(x) >= sum(hmm.table.count(unit) for unit in sequence):
            chain, path = align_states(hmm, compute_log_likelihoods(hmm, x), sequence)
            frames.update(chain.names[position] for position in path)
    frequent = {name for name, count in frames.items() if count >= hmm.config.context_frames}
    table = replace(hmm.table, names=(*hmm.table.names, *sorted(frequent - set(hmm.table.names))))
    new = hmm.mixtures.select(table.parents()[len(hmm.log_stay) :])
    return replace(hmm, table=table, mixtures=hmm.mixtures.concatenate(new))
