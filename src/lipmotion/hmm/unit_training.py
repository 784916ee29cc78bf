"""Embedded training of phone (unit) models from recordings and their words, without labels of phones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.hmm.align import align_states, choose_pronunciations, expand_states
from lipmotion.hmm.baum_welch import (
    Maximise,
    UnitStatistics,
    adapt_contexts,
    add_up,
    baum_welch,
    limit_durations,
    reestimate_mixtures,
    reestimate_states,
    sum_unit_statistics,
)
from lipmotion.hmm.loudness import smooth_level
from lipmotion.hmm.model import HmmConfig, UnitHmm, hmm_from_arrays, hmm_to_arrays, make_plain_states
from lipmotion.hmm.network import compute_log_likelihoods
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.mixture import make_equal_gaussians
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Monitor, Progress

_CHECKPOINT = "phones"
UTTERANCES_PER_BLOCK = 32
"""Utterances whose pronunciations are chosen together, by one worker."""
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
            f"none of {len(utterances)} utterances has a transcript that fits into its recording; "
            "check that transcripts and recordings belong together"
        )
    return _Training(usable, sequences, inventory, config, monitor, checkpoint).run()


class _Stage(NamedTuple):
    """One stage of training.

    prepare : one step before those of EM, which returns a figure for the monitor; None: nothing to prepare
    maximise : the M-step of ``baum_welch``;  em_steps : how often
    """

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

            baum_welch(self._hmm, self._data, self._sequences, steps, stage.maximise, after_step, self._checkpoint)

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
        blocks = (
            slice(start, start + UTTERANCES_PER_BLOCK) for start in range(0, len(self._data), UTTERANCES_PER_BLOCK)
        )
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
        self._hmm = add_contexts(
            replace(self._hmm, bigram=bigram, typical_fit=typical_fit), self._data, self._sequences
        )
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
            chosen = choose_pronunciations(hmm, compute_log_likelihoods(hmm, utterance.features), words, pause)
        except AlignmentError:
            continue
        sequence = tuple(unit for word in chosen for unit in word.units)
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
    log_stay = np.log(1 - 1 / limit_durations(table)).astype(np.float32)
    start = make_equal_gaussians(np.concatenate(data), len(table.names))
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
        posteriors.append((posterior, np.zeros(len(chain.plain))))
    return replace(hmm, mixtures=reestimate_mixtures(hmm, sum_unit_statistics(add_up(hmm, data, chains, posteriors))))


def add_contexts(hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]]) -> UnitHmm:
    """Return models with densities, at first copies, for states in context with enough frames in an alignment."""
    frames: Counter[str] = Counter()
    for x, sequence in zip(data, sequences, strict=True):
        if len(x) >= sum(hmm.table.count(unit) for unit in sequence):
            chain, path = align_states(hmm, compute_log_likelihoods(hmm, x), sequence)
            frames.update(chain.names[position][0] for position in path)
    frequent = {name for name, count in frames.items() if count >= hmm.config.context_frames}
    table = hmm.table.extend(tuple(sorted(frequent - set(hmm.table.names))))
    new = hmm.mixtures.select(table.parents()[len(hmm.log_stay) :])
    return replace(hmm, table=table, mixtures=hmm.mixtures.concatenate(new))
