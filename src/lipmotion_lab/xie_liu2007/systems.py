"""The systems of Xie & Liu 2007, Table 3, the engines of this project beside them, and baselines."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus
from lipmotion.engines import Animator, engine_named
from lipmotion.engines.base import read_presets
from lipmotion.engines.coupled.arrays import coupled_to_arrays
from lipmotion.engines.coupled.chains.product import HMM, UNSEEN_LOSS
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.model import CoupledConfig
from lipmotion.engines.coupled.training.coupled_training import THREADS, grow_models
from lipmotion.errors import InputError
from lipmotion.pipeline.training.channels import with_sound_inputs
from lipmotion.types import Example, Monitor, silent_monitor
from lipmotion_lab.baselines import BlstmBaseline, ContextRidge, MeanPose
from lipmotion_lab.evaluation import held_out
from lipmotion_lab.evaluation.evaluate import sum_correlations, sum_distances
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, ComparedClip, HeldOutRecordings

Options = Mapping[str, Any]
SYSTEMS = {name: options for name, options in read_presets("coupled").items() if "structure" in options}
TIED = {"unseen_loss": UNSEEN_LOSS, "start_asynchrony": 1}
"""Factorial chains that are tied together: rare joint states lose 10 nats, and the chains begin a state apart."""
TOGETHER = {"moves_together": True}
NETWORK_SETTINGS: tuple[Sequence[Options], ...] = (
    [{"rate": rate} for rate in (4e-3, 2e-3, 1e-3, 8e-3, 1.6e-2, 3.2e-2)],
    [{"cells": 192}],
    [{"steps": steps} for steps in (100.0, 200.0)],
)
"""Settings of the BLSTM that are tried, one kind after another."""


@dataclass(frozen=True)
class Trial:
    """One setting that was tried, with its ACC and AMSE on validation recordings."""

    options: Options
    acc: float
    amse: float
    parameters: int


@dataclass(frozen=True)
class TrainedSystem:
    """A system after training, the processor time that took, and the settings its own was chosen from."""

    engine: Any
    model: Any
    seconds: float
    tried: Sequence[Trial] = field(default_factory=tuple)


def find_best_trial(trials: Sequence[Trial]) -> Trial:
    """Return the trial of the highest ACC; of equals the first."""
    return max(trials, key=lambda trial: trial.acc)


def train_stages(
    options: Options, examples: Sequence[Example], monitor: Monitor = silent_monitor, one: TrainedSystem | None = None
) -> Iterator[TrainedSystem]:
    """Yield coupled chains with 1, 2, 4, … Gaussians a state, up to those of the options; ``one``: after this first."""
    config, count = CoupledConfig(**options), 2 if one else 1
    begin_s = process_time() - (one.seconds if one else 0)
    for make_model in grow_models(examples, config, monitor, THREADS, one.model if one else None):
        own = replace(config, mixtures=min(count, config.mixtures), visual_mixtures=min(count, config.visual_mixtures))
        model = make_model().model
        yield TrainedSystem(CoupledEngine(own), model, process_time() - begin_s)
        count *= 2


def judge_systems(
    systems: Iterable[TrainedSystem], validation: HeldOutRecordings
) -> Iterator[tuple[Trial, TrainedSystem]]:
    """Yield every system with its figures on validation recordings."""
    for system in systems:
        made = held_out.generate_clips(validation, AUDIO_ONLY, system.engine, system.model)
        options, parameters = system.engine.config.as_mapping(), system.model.chains.parameters
        yield Trial(options, *measure_system(made), parameters), system


def measure_system(made: Sequence[ComparedClip]) -> tuple[float, float]:
    """Return ACC and AMSE of what a system makes of recordings."""
    both = [clip.generated for clip in made], [clip.original for clip in made]
    return sum_correlations(*both).value, sum_distances(*both).value


def tune_network(examples: Sequence[Example], validation: HeldOutRecordings, monitor: Monitor) -> TrainedSystem:
    """Return the BLSTM whose learning rate, then cells, then steps are the best on validation recordings."""
    hearing: Animator[Any] = BlstmBaseline()
    speech = held_out.make_speech(validation, AUDIO_ONLY, hearing, None)
    candidates: list[tuple[Trial, TrainedSystem]] = []
    for kind in NETWORK_SETTINGS:
        best = find_best_trial([trial for trial, _ in candidates]).options if candidates else {}
        for change in kind:
            options = {**best, **change}
            start_s, engine = process_time(), BlstmBaseline(**options)
            model = engine.fit(examples, monitor).model
            size = sum(array.size for array in model.learned.network.parameters)
            made = held_out.generate_compared(validation, speech, engine, model)
            trial = Trial(options, *measure_system(made), size)
            candidates.append((trial, TrainedSystem(engine, model, process_time() - start_s)))
    return choose_best(candidates)


def split_while_better(candidates: Iterable[tuple[Trial, TrainedSystem]]) -> Iterator[tuple[Trial, TrainedSystem]]:
    """Yield systems of 1, 2, 4, … Gaussians, up to the first that is no better than that before it."""
    best = -np.inf
    for trial, system in candidates:
        yield trial, system
        if trial.acc <= best:
            return
        best = trial.acc


def choose_best(candidates: Sequence[tuple[Trial, TrainedSystem]]) -> TrainedSystem:
    """Return the system of the highest ACC; of equals the first; with all trials."""
    _, best = max(candidates, key=lambda pair: pair[0].acc)
    return replace(best, tried=tuple(trial for trial, _ in candidates))


def as_row(trial: Trial) -> dict[str, Any]:
    """Return a trial as figures; the options of chains are those that ``list_changed_options`` returns."""
    options = trial.options
    chains = "structure" in options
    return asdict(trial) | {"options": list_changed_options(CoupledConfig.parsed(options)) if chains else options}


def list_changed_options(config: CoupledConfig) -> dict[str, Any]:
    """Return the options that are not those of the paper's system of the same structure and chains, as printed."""
    of = {"structure": config.structure, "chains": config.chains}
    printed = next(options for options in SYSTEMS.values() if options.items() >= of.items())
    as_printed = CoupledConfig.parsed(printed).as_mapping()
    missing = object()
    return of | {name: value for name, value in config.as_mapping().items() if as_printed.get(name, missing) != value}


REFERENCE_SYSTEM = "ph-vi-CHMM"
PAPER_FIGURES: dict[str, tuple[float, float]] = {
    "ph-HMM": (8.043, 0.581),
    "ph-MSHMM": (8.050, 0.576),
    "ph-FHMM": (7.778, 0.593),
    "ph-vi-FHMM": (7.679, 0.608),
    "ph-CHMM": (7.239, 0.630),
    "ph-vi-CHMM": (6.911, 0.696),
}
"""AMSE and ACC of the paper's Table 3: eigenlips of another speaker, so only their order compares."""
BEST_PATH = "ph-vi-CHMM, best path"
BLSTM = "BLSTM"
SPLIT, ALL_PATHS, TWO_STAGES = ", K on val", ", all paths", ", two stages"
SOFT = {"start": "soft", "steps": 0}
ABOUT = "about"


@dataclass(frozen=True)
class ComparedSystem:
    """How one system of the table is made.

    make          : returns its engine; None: it is the coupled engine with ``options``
    same_model_as : the system whose model it takes, so that only the conversion differs, by the ``options``
    splits        : its number of Gaussians is chosen on validation recordings, as in the paper (§7.1), or settings of a
                    network, ``NETWORK_SETTINGS``
    second_stage  : it is trained on speech of others without motion as well (§3.4)
    when_named    : it is compared only if it is asked for
    """

    make: Callable[[], Animator[Any]] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    same_model_as: str = ""
    splits: bool = False
    second_stage: bool = False
    when_named: bool = False


def _find_engine(name: str, **options: Any) -> Callable[[], Animator[Any]]:
    return lambda: engine_named(name, options)


COMPARED_SYSTEMS: dict[str, ComparedSystem] = {
    **{name: ComparedSystem(options=SYSTEMS[name]) for name in PAPER_FIGURES},
    **{name + SPLIT: ComparedSystem(options=SYSTEMS[name], splits=True) for name in PAPER_FIGURES},
    **{f"{name}, tied": ComparedSystem(options=SYSTEMS[name] | TIED) for name in ("ph-FHMM", "ph-vi-FHMM")},
    **{f"{name}, together": ComparedSystem(options=SYSTEMS[name] | TOGETHER) for name in ("ph-CHMM", "ph-vi-CHMM")},
    **{name + ALL_PATHS: ComparedSystem(options=SOFT, same_model_as=name) for name in PAPER_FIGURES},
    BEST_PATH: ComparedSystem(options={"conversion": "viterbi"}, same_model_as=REFERENCE_SYSTEM),
    "trajectory CHMM, own means": ComparedSystem(_find_engine("coupled", acoustic_regression=False), when_named=True),
    REFERENCE_SYSTEM + TWO_STAGES: ComparedSystem(
        options=SYSTEMS[REFERENCE_SYSTEM], second_stage=True, when_named=True
    ),
    "trajectory CHMM": ComparedSystem(_find_engine("coupled"), when_named=True),
    "trajectory CHMM" + TWO_STAGES: ComparedSystem(_find_engine("coupled"), second_stage=True, when_named=True),
    "trajectory HMM": ComparedSystem(_find_engine("trajectory"), when_named=True),
    BLSTM: ComparedSystem(BlstmBaseline, splits=True, when_named=True),
    "ridge, ±150 ms": ComparedSystem(ContextRidge),
    "mean pose": ComparedSystem(MeanPose),
}
"""The systems of the table, in its order.

The paper's six are those of ``train --preset``, of one Gaussian a state; ``K on val``: with the number of Gaussians
that was best on validation recordings;
``tied``, ``together``: chains as ``TIED`` and ``TOGETHER`` have them. ``all paths``: expected means given speech, no
EM; ``best path``: means along the best path, no EM.
``own means``: no regression of the visual means on acoustic features.
"""


def select_systems(names: Sequence[str] | None) -> list[str]:
    """Return the systems to compare, in order. Raises InputError: no such system."""
    if names is None:
        return [name for name, system in COMPARED_SYSTEMS.items() if not system.when_named]
    unknown = [name for name in names if name not in COMPARED_SYSTEMS]
    if unknown:
        raise InputError(f"no system {unknown[0]!r}; there are: {', '.join(COMPARED_SYSTEMS)}")
    chosen = [COMPARED_SYSTEMS[name] for name in names]
    needed = {REFERENCE_SYSTEM, *(each.same_model_as for each in chosen), *(name.removesuffix(SPLIT) for name in names)}
    return [name for name in COMPARED_SYSTEMS if name in {*names, *needed}]


def with_inputs_of(name: str, examples: Sequence[Example], corpus: Corpus) -> Sequence[Example]:
    """Return examples with what a system takes from their sound, as ``lipmotion train`` gives it to an engine."""
    make = COMPARED_SYSTEMS[name].make
    if make is None:
        return examples
    sound = {example.name: corpus.utterance(example.name).audio for example in examples}
    return with_sound_inputs(make(), examples, sound, silent_monitor, map)


def train_system(
    name: str,
    examples: Sequence[Example],
    validation: HeldOutRecordings | None,
    trained: Mapping[str, TrainedSystem],
    mixtures: int,
    monitor: Monitor,
) -> TrainedSystem:
    """Return one trained system.

    validation : recordings that decide between 1, 2, 4, … Gaussians, or settings of a network; None: nothing does
    mixtures   : most Gaussians a state, of both streams and of speech only
    """
    system = COMPARED_SYSTEMS[name]
    if system.same_model_as:
        twin = trained[system.same_model_as]
        return replace(twin, engine=CoupledEngine(replace(twin.engine.config, **system.options)))
    if system.make is BlstmBaseline and validation is not None:
        return tune_network(examples, validation, monitor)
    if system.make is not None:
        start_s, engine = process_time(), system.make()
        return TrainedSystem(engine, engine.fit(examples, monitor).model, process_time() - start_s)
    if system.splits and validation is not None:
        one = trained[name.removesuffix(SPLIT)]
        first = [*judge_systems([one], validation)]
        candidates = [*first]
        for more in [{"visual_mixtures": mixtures}, {}][: 1 if system.options["structure"] == HMM else 2]:
            grown = train_stages({**system.options, "mixtures": mixtures, **more}, examples, monitor, one)
            candidates += [*split_while_better(chain(first, judge_systems(grown, validation)))][1:]
        return choose_best(candidates)
    *_, last = train_stages(system.options, examples, monitor)
    return last


def system_to_arrays(system: TrainedSystem) -> dict[str, NDArray[Any]]:
    """Return the coupled chains of a system as arrays, from which ``system_from_arrays`` makes it again."""
    about = {"config": system.engine.config.as_mapping(), "seconds": system.seconds}
    about["tried"] = [asdict(trial) for trial in system.tried]
    return coupled_to_arrays(system.model) | {ABOUT: np.array(json.dumps(about))}


def system_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> TrainedSystem:
    """Return the system that ``system_to_arrays`` stored."""
    about = json.loads(str(arrays[ABOUT]))
    engine = CoupledEngine(CoupledConfig.parsed(about["config"]))
    model = engine.from_arrays({name: array for name, array in arrays.items() if name != ABOUT})
    return TrainedSystem(engine, model, about["seconds"], tuple(Trial(**trial) for trial in about["tried"]))
