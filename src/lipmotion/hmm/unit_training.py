"""Embedded training of unit models from transcripts without unit labels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.hmm.align import StateSequence, align_states, choose_pronunciations, expand_states
from lipmotion.hmm.baum_welch import (
    UnitStatistics,
    adapt_contexts,
    baum_welch,
    collect_statistics,
    max_mean_durations,
    reestimate_mixtures,
)
from lipmotion.hmm.log_likelihoods import compute_log_likelihoods
from lipmotion.hmm.loudness import smooth_level
from lipmotion.hmm.model import HmmConfig, UnitHmm, hmm_from_arrays, hmm_to_arrays
from lipmotion.hmm.states import make_plain_states
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.mixture import make_equal_gaussians
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Monitor, ParallelMap, Progress

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
    """The units to model. ``silence`` surrounds every utterance, ``pause`` may stand between words.

    energy : the column of the features that holds the log energy
    """

    silence: str
    pause: str
    energy: int


@dataclass(frozen=True, eq=False)
class _State:
    """What training passes from one step to the next: the models, and the assumed unit sequence of every utterance."""

    hmm: UnitHmm
    sequences: tuple[tuple[str, ...], ...]


_Report = Callable[[_State, float | None], None]
"""Called after every step with the state after it, and a figure for the monitor (None: there is none)."""


@dataclass(frozen=True, eq=False)
class _Stage:
    """One stage of training: a preparation, then steps of EM.

    prepare  : one step, which changes the state and returns it with a figure for the monitor; None: nothing to prepare
    run_em   : takes a number of EM steps; None: there are none
    em_steps : how many
    """

    name: str
    prepare: Callable[[_State], tuple[_State, float | None]] | None
    run_em: Callable[[_State, int, _Report], _State] | None
    em_steps: int

    @property
    def steps(self) -> int:
        """How many steps there are in all."""
        return (self.prepare is not None) + self.em_steps

    def run(self, state: _State, done: int, report: _Report) -> _State:
        """Take all steps but the first ``done``; return the state after them."""
        em_steps = self.steps - done
        if self.prepare is not None and done == 0:
            state, figure = self.prepare(state)
            report(state, figure)
            em_steps = self.em_steps
        return self.run_em(state, em_steps, report) if self.run_em is not None and em_steps else state


def train_hmm(
    utterances: Sequence[TranscribedUtterance],
    inventory: UnitInventory,
    config: HmmConfig,
    monitor: Monitor,
    checkpoint: Checkpoint = NO_CHECKPOINT,
    parallel_map: ParallelMap = map,
) -> UnitHmm:
    """Return models of all units in the transcripts.

    Stages: flat start with the first pronunciations; choice of pronunciations and pauses; mixtures by
    splitting; the choice again; states in context. Each stage is embedded Baum–Welch over whole utterances.
    checkpoint : after every step, all that the next one needs is stored there
    parallel_map : distributes the work; the result is the same to the bit
    Raises CorpusError: no utterance, or none long enough for its transcript.
    """
    sequences = [_first_guess(u, inventory) for u in utterances]
    usable = [i for i, (u, s) in enumerate(zip(utterances, sequences, strict=True)) if _fits(u, s, config)]
    if not usable:
        raise CorpusError(
            f"none of {len(utterances)} utterances has a transcript that fits into its recording; "
            "check that transcripts and recordings belong together"
        )
    training = _Training([utterances[i] for i in usable], inventory, config, parallel_map)
    done, state = _restored(checkpoint, config) or (0, training.flat_start([sequences[i] for i in usable]))
    stages = training.stages()
    total, first = sum(stage.steps for stage in stages), 0
    for stage in stages:
        if max(first, done) < first + stage.steps:
            state = _run_stage(stage, state, _Position(first, max(first, done), total), monitor, checkpoint)
        first += stage.steps
    return state.hmm


@dataclass(frozen=True)
class _Position:
    """Where training is: the number of the stage's first step, of the next step, and of all steps."""

    stage_start: int
    next_step: int
    total: int


def _run_stage(stage: _Stage, state: _State, at: _Position, monitor: Monitor, checkpoint: Checkpoint) -> _State:
    """Return the state after a stage; every step is stored and reported."""
    number, total = at.next_step, at.total
    monitor(Progress(stage.name, number, total, number / total))

    def report(state: _State, figure: float | None) -> None:
        nonlocal number
        number += 1
        _store(checkpoint, number, state)
        monitor(Progress(stage.name, number, total, number / total, figure))

    return stage.run(state, at.next_step - at.stage_start, report)


_CHECKPOINT = "phones"


def _store(checkpoint: Checkpoint, done: int, state: _State) -> None:
    sequences = np.array([" ".join(units) for units in state.sequences])
    checkpoint.save(_CHECKPOINT, {**hmm_to_arrays(state.hmm, np.float32), "said": sequences, "done": np.array(done)})


def _restored(checkpoint: Checkpoint, config: HmmConfig) -> tuple[int, _State] | None:
    """Return how many steps were done, and the state after them; None: nothing was stored."""
    arrays = checkpoint.load(_CHECKPOINT)
    if arrays is None:
        return None
    sequences = tuple(tuple(units.split()) for units in arrays["said"].tolist())
    stored = {name: array for name, array in arrays.items() if name not in ("done", "said")}
    return int(arrays["done"]), _State(hmm_from_arrays(stored, config), sequences)


class _Training:
    """The stages of training over the same utterances."""

    def __init__(
        self,
        utterances: Sequence[TranscribedUtterance],
        inventory: UnitInventory,
        config: HmmConfig,
        parallel_map: ParallelMap,
    ) -> None:
        self._utterances, self._inventory, self._config, self._parallel_map = (
            utterances,
            inventory,
            config,
            parallel_map,
        )
        self._data = [utterance.features for utterance in utterances]

    def flat_start(self, sequences: Sequence[tuple[str, ...]]) -> _State:
        """Return the state that training begins with."""
        return _State(_flat_start(self._data, sequences, self._inventory, self._config), tuple(sequences))

    def stages(self) -> list[_Stage]:
        """Return all stages in order."""
        steps = self._config.iterations
        stages = [
            _Stage("flat start", None, self._baum_welch, 2 * steps),
            _Stage("pronunciations", self._choose_with_pause, self._baum_welch, steps),
        ]
        count, frames = 1, sum(map(len, self._data))
        states = self._config.states * len(
            {unit for utterance in self._utterances for word in utterance.words for unit in word[0]}
        )
        while count < self._config.mixtures and frames >= 2 * count * FRAMES_A_GAUSSIAN * states:
            count *= 2
            stages.append(_Stage(f"{count} Gaussians", _split, self._baum_welch, steps))
        return [
            *stages,
            _Stage("pronunciations again", self._choose_pronunciations, self._baum_welch, steps),
            _Stage("states in context", self._add_contexts, None, 0),
            _Stage("contexts", None, self._adapt, steps),
        ]

    def _baum_welch(self, state: _State, steps: int, report: _Report) -> _State:
        def after_step(_: int, hmm: UnitHmm, statistics: UnitStatistics) -> None:
            report(replace(state, hmm=hmm), statistics.mean_log_likelihood)

        result = baum_welch(state.hmm, self._data, state.sequences, steps, after_step, self._parallel_map)
        return replace(state, hmm=result.model)

    def _adapt(self, state: _State, steps: int, report: _Report) -> _State:
        """Adapt the states in context; where there are none, only report the steps."""
        if len(state.hmm.table.names) == len(state.hmm.log_stay):
            for _ in range(steps):
                report(state, None)
            return state

        def after_step(_: int, hmm: UnitHmm, statistics: UnitStatistics) -> None:
            report(replace(state, hmm=hmm), statistics.mean_log_likelihood)

        result = adapt_contexts(state.hmm, self._data, state.sequences, steps, after_step, self._parallel_map)
        return replace(state, hmm=result.model)

    def _choose_with_pause(self, state: _State) -> tuple[_State, None]:
        return self._choose_pronunciations(replace(state, hmm=_with_pause(state.hmm, self._inventory)))

    def _choose_pronunciations(self, state: _State) -> tuple[_State, None]:
        jobs = (
            _ChoiceJob(
                state.hmm,
                self._utterances[start : start + UTTERANCES_PER_BLOCK],
                state.sequences[start : start + UTTERANCES_PER_BLOCK],
            )
            for start in range(0, len(state.sequences), UTTERANCES_PER_BLOCK)
        )
        chosen = self._parallel_map(partial(_chosen_sequences, inventory=self._inventory), jobs)
        return replace(state, sequences=tuple(units for sequences in chosen for units in sequences)), None

    def _add_contexts(self, state: _State) -> tuple[_State, float]:
        """Give states in contexts with enough data densities of their own, copies of those without context at first.

        The figure is their number.
        """
        spoken = [_without_pauses(units, self._inventory) for units in state.sequences]
        typical_fit = float(np.mean([state.hmm.fit(x) for x in self._data]))
        bigram = estimate_bigram(state.hmm.table.units, spoken)
        hmm = replace(state.hmm, bigram=bigram, typical_fit=typical_fit)
        contexts = _frequent_contexts(hmm, self._data, state.sequences)
        return replace(state, hmm=_with_contexts(hmm, contexts)), len(contexts)


def _split(state: _State) -> tuple[_State, None]:
    return replace(state, hmm=replace(state.hmm, mixtures=state.hmm.mixtures.split())), None


def _first_guess(utterance: TranscribedUtterance, inventory: UnitInventory) -> tuple[str, ...]:
    """Return the first pronunciation of every word, with silence before and after them."""
    spoken = [unit for word in utterance.words for unit in word[0]]
    return (inventory.silence, *spoken, inventory.silence)


def _fits(utterance: TranscribedUtterance, sequence: Sequence[str], config: HmmConfig) -> bool:
    return len(utterance.features) >= config.states * len(sequence)


def _without_pauses(sequence: Sequence[str], inventory: UnitInventory) -> tuple[str, ...]:
    return tuple(inventory.silence if unit == inventory.pause else unit for unit in sequence)


def _with_pause(hmm: UnitHmm, inventory: UnitInventory) -> UnitHmm:
    """Return models whose pause has the density of the middle of silence: no first guess contains a pause."""
    mixtures, pause = hmm.mixtures.copy(), hmm.table.density(inventory.pause, 0)
    silence = hmm.table.density(inventory.silence, hmm.table.count(inventory.silence) // 2)
    for array in (mixtures.log_weights, mixtures.means, mixtures.variances):
        array[pause] = array[silence]
    return replace(hmm, mixtures=mixtures)


@dataclass(frozen=True, eq=False)
class _ChoiceJob:
    """Some utterances, the models that choose their pronunciations, and the unit sequences assumed before."""

    hmm: UnitHmm
    utterances: Sequence[TranscribedUtterance]
    before: Sequence[tuple[str, ...]]


def _chosen_sequences(job: _ChoiceJob, inventory: UnitInventory) -> list[tuple[str, ...]]:
    pairs = zip(job.utterances, job.before, strict=True)
    return [_chosen_sequence(job.hmm, utterance, before, inventory) for utterance, before in pairs]


def _chosen_sequence(
    hmm: UnitHmm, utterance: TranscribedUtterance, before: tuple[str, ...], inventory: UnitInventory
) -> tuple[str, ...]:
    """Return the most probable unit sequence, pauses included; ``before`` where it does not fit into the frames."""
    known = set(hmm.table.units)
    words = [[v for v in variants if set(v) <= known] or variants[:1] for variants in utterance.words]
    try:
        chosen = choose_pronunciations(hmm, compute_log_likelihoods(hmm, utterance.features), words, inventory.pause)
    except AlignmentError:
        return before
    sequence = tuple(unit for word in chosen for unit in word.units)
    states = sum(hmm.table.count(unit) for unit in sequence)
    return sequence if states <= len(utterance.features) else before


def _flat_start(
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
    log_stay = np.log(1 - 1 / max_mean_durations(table)).astype(np.float32)
    start = make_equal_gaussians(np.concatenate(data), len(table.names))
    hmm = UnitHmm(config, table, start, log_stay, estimate_bigram(units, []))
    statistics = UnitStatistics(hmm)
    for x, sequence in zip(data, sequences, strict=True):
        chain = expand_states(hmm, sequence)
        posterior = np.zeros((len(x), len(chain.plain)))
        posterior[np.arange(len(x)), _initial_path(x[:, inventory.energy], chain, len(sequence))] = 1
        statistics.add(x, collect_statistics(chain, posterior, np.zeros(len(chain.plain))))
    return replace(hmm, mixtures=reestimate_mixtures(hmm, statistics, data))


def _initial_path(energy: NDArray[np.float32], chain: StateSequence, units: int) -> NDArray[np.intp]:
    """Return a first guess of the state in each frame [shape=(T,)].

    energy : log energy [shape=(T,)]
    chain  : the states of the utterance, of so many units
    Silence lasts up to the first loud frame, and from the last one; the other states divide the rest evenly.
    """
    above = np.nonzero(smooth_level(energy, ONSET_FRAMES) > 0)[0]
    onset, offset = (int(above[0]), int(above[-1]) + 1) if len(above) else (0, len(energy))
    silence = int((chain.positions == 0).sum())
    speech = int(((chain.positions > 0) & (chain.positions < units - 1)).sum())
    path = np.empty(len(energy), np.intp)
    path[:onset] = np.arange(onset) * silence // max(onset, 1)
    path[onset:offset] = silence + np.arange(offset - onset) * speech // max(offset - onset, 1)
    tail = len(energy) - offset
    path[offset:] = silence + speech + np.arange(tail) * (len(chain.plain) - silence - speech) // max(tail, 1)
    return path


def _with_contexts(hmm: UnitHmm, names: tuple[str, ...]) -> UnitHmm:
    """Return models with more states in context, whose densities are copies of those without context."""
    table = hmm.table.extended(names)
    new = hmm.mixtures.selected(table.parents()[len(hmm.log_stay) :])
    return replace(hmm, table=table, mixtures=hmm.mixtures.concatenated(new))


def _frequent_contexts(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]]
) -> tuple[str, ...]:
    """Return the names of all states in context that have enough frames in an alignment of the data."""
    frames: Counter[str] = Counter()
    for x, sequence in zip(data, sequences, strict=True):
        if len(x) >= sum(hmm.table.count(unit) for unit in sequence):
            names, path = align_states(hmm, compute_log_likelihoods(hmm, x), sequence)
            frames.update(names[position][0] for position in path)
    frequent = {name for name, count in frames.items() if count >= hmm.config.context_frames}
    return tuple(sorted(frequent - set(hmm.table.names)))
