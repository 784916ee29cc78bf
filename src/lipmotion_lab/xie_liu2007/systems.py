"""The systems of Xie & Liu 2007, Table 3, the engines of this project beside them, and baselines."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.store import Corpus
from lipmotion.engines import Animator, Engine, engine_named
from lipmotion.engines.coupled.arrays import coupled_arrays
from lipmotion.engines.coupled.chains.structures import SYSTEMS
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.errors import InputError
from lipmotion.pipeline.training.sound_inputs import with_sound_inputs
from lipmotion.types import Example, Monitor, silent_monitor
from lipmotion_lab.baselines.frame_regression import ContextRidge, LoudnessRegression, MeanPose
from lipmotion_lab.baselines.recurrent import BlstmBaseline, import_torch
from lipmotion_lab.evaluation.held_out import HeldOutRecordings
from lipmotion_lab.xie_liu2007.tuning import (
    CONVERSIONS,
    FREE,
    TrainedSystem,
    Trial,
    TuningOptions,
    alternatives,
    best_trial,
    chosen_by,
    judged,
    trained_on_the_way,
    tuned,
)

REFERENCE_SYSTEM = "ph-vi-CHMM"
"""The system that every other one is compared with."""
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
TUNED = ", tuned"
ABOUT = "about"
"""Name of the array with settings and figures of a stored system."""
MATCHED = "ph-MSHMM, as large as ph-vi-FHMM"


@dataclass(frozen=True)
class ComparedSystem:
    """How one system of the table is made.

    make          : returns its engine; None: it is the coupled engine with ``options``
    options       : of the coupled engine
    same_model_as : the system whose model it takes, so that only the conversion differs, by the ``options``
    tunes         : the system of the paper whose settings are chosen on validation recordings
    when_named    : it is compared only if it is asked for
    """

    make: Callable[[], Animator[Any]] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    same_model_as: str = ""
    tunes: str = ""
    when_named: bool = False

    @property
    def is_trained_here(self) -> bool:
        """Whether it is coupled chains of its own."""
        return self.make is None and not self.same_model_as


def _engine(name: str, **options: Any) -> Callable[[], Animator[Any]]:
    return lambda: engine_named(name, options)


COMPARED_SYSTEMS: dict[str, ComparedSystem] = {
    **{name: ComparedSystem(options=SYSTEMS[name]) for name in PAPER_FIGURES},
    **{name + TUNED: ComparedSystem(options=SYSTEMS[name], tunes=name) for name in PAPER_FIGURES},
    MATCHED: ComparedSystem(options=SYSTEMS["ph-MSHMM"], tunes="ph-MSHMM"),
    "ph-vi-FHMM, free": ComparedSystem(options=SYSTEMS["ph-vi-FHMM"] | FREE),
    "ph-vi-CHMM, soft start": ComparedSystem(options={"start": "soft"}, same_model_as=REFERENCE_SYSTEM),
    BEST_PATH: ComparedSystem(options={"conversion": "viterbi"}, same_model_as=REFERENCE_SYSTEM),
    "trajectory CHMM, own means": ComparedSystem(_engine("coupled", acoustic_regression=False), when_named=True),
    "trajectory CHMM": ComparedSystem(_engine("coupled"), when_named=True),
    "trajectory HMM": ComparedSystem(_engine("trajectory"), when_named=True),
    BLSTM: ComparedSystem(BlstmBaseline, when_named=True),
    "ridge, ±150 ms": ComparedSystem(ContextRidge),
    "loudness": ComparedSystem(LoudnessRegression),
    "mean pose": ComparedSystem(MeanPose),
}
"""The systems of the table, in its order.

The paper's six are those of ``train --preset``; ``tuned``: with the settings that were best on validation recordings;
``as large as``: with as many Gaussians as bring the number of parameters nearest to that of the tuned ph-vi-FHMM.
``free``: factorial chains as ``tuning.FREE`` has them. ``best path``: means along the best path, no EM.
``own means``: no regression of the visual means on acoustic features.
"""


def selected_systems(names: Sequence[str] | None) -> list[str]:
    """Return the names of the systems to compare, in the table's order; always with ``REFERENCE_SYSTEM``.

    names : None: all but those that are compared only ``when_named``
    Raises InputError: no such system. Raises MissingDependencyError: a named system needs a package that is missing.
    """
    if names is None:
        return [name for name, system in COMPARED_SYSTEMS.items() if not system.when_named]
    unknown = [name for name in names if name not in COMPARED_SYSTEMS]
    if unknown:
        raise InputError(f"no system {unknown[0]!r}; there are: {', '.join(COMPARED_SYSTEMS)}")
    if BLSTM in names:
        import_torch()
    needed = {REFERENCE_SYSTEM} | {COMPARED_SYSTEMS[name].tunes for name in names}
    if MATCHED in names:
        needed |= {"ph-vi-FHMM", "ph-vi-FHMM" + TUNED}
    return [name for name in COMPARED_SYSTEMS if name in {*names, *needed}]


def tuned_options(
    name: str, examples: Sequence[Example], validation: HeldOutRecordings, tuning: TuningOptions, monitor: Monitor
) -> list[Trial]:
    """Return all settings that were tried for a system of the paper.

    validation : recordings by which they are judged; the first ``tuning.judges`` of them
    """
    judges = validation.first(tuning.judges)

    def attempt(options: Mapping[str, Any]) -> list[Trial]:
        on_the_way = trained_on_the_way(options, examples, monitor)
        return [trial for trial, _ in judged(on_the_way, judges, CONVERSIONS)]

    return tuned(SYSTEMS[name], alternatives(SYSTEMS[name], tuning), attempt)


def with_inputs_of(name: str, examples: Sequence[Example], corpus: Corpus) -> Sequence[Example]:
    """Return examples with what a system takes from their sound, as ``lipmotion train`` gives it to an engine."""
    make = COMPARED_SYSTEMS[name].make
    engine = make() if make is not None else None
    if not isinstance(engine, Engine):
        return examples
    sound = {example.name: corpus.utterance(example.name).audio for example in examples}
    return with_sound_inputs(engine, examples, sound, silent_monitor, map)


def train_system(
    name: str,
    examples: Sequence[Example],
    validation: HeldOutRecordings | None,
    trials: Mapping[str, Sequence[Trial]],
    trained: Mapping[str, TrainedSystem],
    monitor: Monitor,
) -> TrainedSystem:
    """Return one trained system.

    validation : recordings that decide between the settings of a tuned system with 1, 2, 4, … Gaussians, and those of
                 the system as printed; None: no system is tuned
    trials     : what was tried on fewer recordings, for each system of the paper that is tuned
    trained    : the systems before it
    """
    system = COMPARED_SYSTEMS[name]
    if system.same_model_as:
        twin = trained[system.same_model_as]
        return replace(twin, engine=CoupledEngine(replace(twin.engine.config, **system.options)))
    if system.make is not None:
        start_s, engine = process_time(), system.make()
        return TrainedSystem(engine, engine.fit(examples, monitor).model, process_time() - start_s)
    if not system.tunes or validation is None:
        *_, last = trained_on_the_way(system.options, examples, monitor)
        return last
    options = best_trial(trials[system.tunes]).options
    if name != MATCHED:
        printed = trained[system.tunes]
        same = CoupledConfig.parsed(options) == printed.engine.config
        on_the_way = () if same else trained_on_the_way(options, examples, monitor)
        return chosen_by(lambda trial: trial.acc, judged([printed, *on_the_way], validation))
    wanted = trained["ph-vi-FHMM" + TUNED].model.chains.parameters
    most = max(trial.options["mixtures"] for trial in trials[system.tunes])
    larger = trained_on_the_way({**options, "mixtures": most, "visual_mixtures": most}, examples, monitor)
    return chosen_by(lambda trial: -abs(trial.parameters - wanted), judged(larger, validation))


def stored_system(system: TrainedSystem) -> dict[str, NDArray[Any]]:
    """Return the coupled chains of a system as arrays, from which ``system_from_arrays`` makes it again."""
    about = {"config": system.engine.config.as_mapping(), "seconds": system.seconds}
    about["tried"] = [asdict(trial) for trial in system.tried]
    return coupled_arrays(system.model) | {ABOUT: np.array(json.dumps(about))}


def system_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> TrainedSystem:
    """Return the system that ``stored_system`` stored."""
    about = json.loads(str(arrays[ABOUT]))
    engine = CoupledEngine(CoupledConfig.parsed(about["config"]))
    model = engine.from_arrays({name: array for name, array in arrays.items() if name != ABOUT})
    return TrainedSystem(engine, model, about["seconds"], tuple(Trial(**trial) for trial in about["tried"]))
