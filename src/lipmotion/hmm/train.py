"""Embedded training from transcripts without unit labels: flat start, plain units, mixtures, contexts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.hmm.align import Chain, chain_of, choose_pronunciations, state_path
from lipmotion.hmm.em import Statistics, adapt_contexts, baum_welch, longest, maximised, utterance_statistics
from lipmotion.hmm.log_likelihoods import log_likelihoods_of
from lipmotion.hmm.loudness import loud_frames
from lipmotion.hmm.model import HmmConfig, UnitHmm, hmm_arrays, hmm_from_arrays
from lipmotion.hmm.states import plain_states
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.mixture import single_gaussian
from lipmotion.storage.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.types import Monitor, ParallelMap, Progress

AT_A_TIME = 32
"""Utterances whose pronunciations are chosen together, by one worker."""
ONSET_FRAMES = 21
"""For the flat start, speech is where the energy is loud, averaged over so many frames. Without averaging a click or
a breath is the end of speech, and the state before it takes the silence for its own: the last words of GRID then
ended up to 0.8 s late."""


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


@dataclass(frozen=True, eq=False)
class _State:
    """What training carries from one step to the next: the models, and the units said in every utterance."""

    hmm: UnitHmm
    said: tuple[tuple[str, ...], ...]


FRAMES_A_GAUSSIAN = 25
"""Mixtures are split while so many frames are left for each Gaussian on the average. With 20 clips of GRID, 2 and not 8
raise ACC of opening on the validation list from 0.753 to 0.767, audio only; with 50, 4 raise it from 0.840 to 0.855."""
_Step = Callable[[_State], tuple[_State, float | None]]
"""Gives the next state, and the mean log likelihood per frame (or another figure) if it found one."""


def train_hmm(
    utterances: Sequence[Transcribed],
    inventory: UnitInventory,
    config: HmmConfig,
    monitor: Monitor,
    checkpoint: Checkpoint = NOTHING_KEPT,
    each: ParallelMap = map,
) -> UnitHmm:
    """Train models of every unit that the utterances say.

    Stages: flat start with the first pronunciations; choice of pronunciations and pauses; mixtures by
    splitting; the choice again; states in context. Each stage is embedded Baum–Welch over whole utterances.
    checkpoint : after every step, all that the next one needs is kept there
    each       : shares the work; the result is the same to the bit
    Raises CorpusError: no utterance, or none long enough for its transcript.
    """
    sequences = [_first_guess(u, inventory) for u in utterances]
    kept = [i for i, (u, s) in enumerate(zip(utterances, sequences, strict=True)) if _fits(u, s, config)]
    if not kept:
        raise CorpusError(
            f"none of {len(utterances)} utterances has a transcript that fits into its recording; "
            "check that transcripts and recordings belong together"
        )
    training = _Training([utterances[i] for i in kept], inventory, config, each)
    steps = training.steps()
    done, state = _restored(checkpoint, config) or (0, training.flat_start([sequences[i] for i in kept]))
    for number, (stage, step) in enumerate(steps[done:], start=done):
        if number == done or stage != steps[number - 1][0]:
            monitor(Progress(stage, number, len(steps), number / len(steps)))
        state, figure = step(state)
        _keep(checkpoint, number + 1, state)
        monitor(Progress(stage, number + 1, len(steps), (number + 1) / len(steps), figure))
    return state.hmm


_CHECKPOINT = "phones"


def _keep(checkpoint: Checkpoint, done: int, state: _State) -> None:
    said = np.array([" ".join(units) for units in state.said])
    checkpoint.save(_CHECKPOINT, {**hmm_arrays(state.hmm, np.float32), "said": said, "done": np.array(done)})


def _restored(checkpoint: Checkpoint, config: HmmConfig) -> tuple[int, _State] | None:
    """Return how many steps were done, and the state after them; None where nothing was kept."""
    arrays = checkpoint.load(_CHECKPOINT)
    if arrays is None:
        return None
    said = tuple(tuple(units.split()) for units in arrays["said"].tolist())
    stored = {name: array for name, array in arrays.items() if name not in ("done", "said")}
    return int(arrays["done"]), _State(hmm_from_arrays(stored, config), said)


class _Training:
    """The steps of training, each from one state to the next, over the same utterances."""

    def __init__(
        self, utterances: Sequence[Transcribed], inventory: UnitInventory, config: HmmConfig, each: ParallelMap
    ) -> None:
        self._utterances, self._inventory, self._config, self._each = utterances, inventory, config, each
        self._data = [utterance.features for utterance in utterances]

    def flat_start(self, sequences: Sequence[tuple[str, ...]]) -> _State:
        """Return the state that training begins with."""
        return _State(_flat_start(self._data, sequences, self._inventory, self._config), tuple(sequences))

    def steps(self) -> list[tuple[str, _Step]]:
        """Return all steps with the stage that each belongs to."""
        again: list[_Step] = [self._improve] * self._config.iterations
        stages: dict[str, list[_Step]] = {
            "flat start": [*again, *again],
            "pronunciations": [self._pronounce_with_pause, *again],
        }
        count, frames = 1, sum(map(len, self._data))
        states = self._config.states * len(
            {unit for said in self._utterances for word in said.words for unit in word[0]}
        )
        while count < self._config.mixtures and frames >= 2 * count * FRAMES_A_GAUSSIAN * states:
            count *= 2
            stages[f"{count} Gaussians"] = [_split, *again]
        stages["pronunciations again"] = [self._pronounce, *again]
        stages["states in context"] = [self._find_contexts]
        stages["contexts"] = [self._adapt] * self._config.iterations
        return [(stage, step) for stage, steps in stages.items() for step in steps]

    def _improve(self, state: _State) -> tuple[_State, float]:
        hmm, log_likelihood = baum_welch(state.hmm, self._data, state.said, self._each)
        return replace(state, hmm=hmm), log_likelihood

    def _pronounce_with_pause(self, state: _State) -> tuple[_State, None]:
        return self._pronounce(replace(state, hmm=_with_pause(state.hmm, self._inventory)))

    def _pronounce(self, state: _State) -> tuple[_State, None]:
        jobs = (
            _Heard(state.hmm, self._utterances[start : start + AT_A_TIME], state.said[start : start + AT_A_TIME])
            for start in range(0, len(state.said), AT_A_TIME)
        )
        said = self._each(partial(_pronounced_all, inventory=self._inventory), jobs)
        return replace(state, said=tuple(units for some in said for units in some)), None

    def _find_contexts(self, state: _State) -> tuple[_State, float]:
        """Give states in contexts with enough data densities of their own, the same as without context at first."""
        spoken = [_without_pauses(units, self._inventory) for units in state.said]
        typical_fit = float(np.mean([state.hmm.fit(x) for x in self._data]))
        bigram = estimate_bigram(state.hmm.table.units, spoken)
        hmm = replace(state.hmm, bigram=bigram, typical_fit=typical_fit)
        contexts = _frequent_contexts(hmm, self._data, state.said)
        return replace(state, hmm=_with_contexts(hmm, contexts)), len(contexts)

    def _adapt(self, state: _State) -> tuple[_State, float | None]:
        hmm, log_likelihood = adapt_contexts(state.hmm, self._data, state.said, self._each)
        return replace(state, hmm=hmm), log_likelihood


def _split(state: _State) -> tuple[_State, None]:
    return replace(state, hmm=replace(state.hmm, mixtures=state.hmm.mixtures.split())), None


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


@dataclass(frozen=True, eq=False)
class _Heard:
    """Some utterances, the models that they are heard with, and the units that were assumed before."""

    hmm: UnitHmm
    utterances: Sequence[Transcribed]
    before: Sequence[tuple[str, ...]]


def _pronounced_all(job: _Heard, inventory: UnitInventory) -> list[tuple[str, ...]]:
    pairs = zip(job.utterances, job.before, strict=True)
    return [_pronounced(job.hmm, utterance, before, inventory) for utterance, before in pairs]


def _pronounced(
    hmm: UnitHmm, utterance: Transcribed, before: tuple[str, ...], inventory: UnitInventory
) -> tuple[str, ...]:
    """Return the units said, pauses included; what was assumed before where they do not fit."""
    known = set(hmm.table.units)
    words = [[v for v in variants if set(v) <= known] or variants[:1] for variants in utterance.words]
    try:
        chosen = choose_pronunciations(hmm, log_likelihoods_of(hmm, utterance.features), words, inventory.pause)
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
    log_stay = np.log(1 - 1 / longest(table)).astype(np.float32)
    start = single_gaussian(np.concatenate(data), len(table.names))
    hmm = UnitHmm(config, table, start, log_stay, estimate_bigram(units, []))
    statistics = Statistics(hmm)
    for x, sequence in zip(data, sequences, strict=True):
        chain = chain_of(hmm, sequence)
        posterior = np.zeros((len(x), len(chain.plain)))
        posterior[np.arange(len(x)), _even_path(x[:, inventory.energy], chain, len(sequence))] = 1
        statistics.add(x, utterance_statistics(chain, posterior, np.zeros(len(chain.plain))))
    return replace(hmm, mixtures=maximised(hmm, statistics, data))


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


def _with_contexts(hmm: UnitHmm, names: tuple[str, ...]) -> UnitHmm:
    table = hmm.table.extended(names)
    new = hmm.mixtures.picked(table.parents()[len(hmm.log_stay) :])
    return replace(hmm, table=table, mixtures=hmm.mixtures.joined(new))


def _frequent_contexts(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]]
) -> tuple[str, ...]:
    """Return the names of all states in contexts with enough frames."""
    frames: Counter[str] = Counter()
    for x, sequence in zip(data, sequences, strict=True):
        if len(x) >= sum(hmm.table.count(unit) for unit in sequence):
            names, path = state_path(hmm, log_likelihoods_of(hmm, x), sequence)
            frames.update(names[position][0] for position in path)
    frequent = {name for name, count in frames.items() if count >= hmm.config.context_frames}
    return tuple(sorted(frequent - set(hmm.table.names)))
