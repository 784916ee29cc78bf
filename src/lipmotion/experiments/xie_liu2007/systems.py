"""The systems of Xie & Liu 2007, Table 3, the engines of this project beside them, and baselines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

from lipmotion.engines import Animator, engine_named
from lipmotion.engines.coupled.chains.structures import SYSTEMS
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.errors import InputError
from lipmotion.experiments.baselines.frame_regression import ContextRidge, LoudnessRegression, MeanPose
from lipmotion.experiments.baselines.recurrent import BlstmBaseline, import_torch, torch_is_installed
from lipmotion.experiments.xie_liu2007.mixtures import select_mixtures
from lipmotion.pipeline.evaluation.held_out import HeldOutRecordings
from lipmotion.types import Example, Monitor, sub_monitor

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
PAPER_CONVERSION: dict[str, Any] = {
    "conversion": "em",
    "start": "viterbi",
    "steps": 10,
    "variance_scaling": False,
    "closures": False,
}
"""Conversion as in the paper: frame by frame, started from the best path, without changes to the generated motion."""
BEST_PATH = "ph-vi-CHMM, best path"
BLSTM = "BLSTM"


@dataclass(frozen=True)
class ComparedSystem:
    """How one system of the table is made.

    make          : returns its engine; None: it is the coupled engine with ``options``, and its number of Gaussians is
                    selected on validation recordings
    options       : of the coupled engine
    same_model_as : the system whose model it takes, so that only the conversion differs, by the ``options``
    """

    make: Callable[[], Animator[Any]] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    same_model_as: str = ""


def _engine(name: str, **options: Any) -> Callable[[], Animator[Any]]:
    return lambda: engine_named(name, options)


COMPARED_SYSTEMS: dict[str, ComparedSystem] = {
    **{name: ComparedSystem(options=PAPER_CONVERSION | SYSTEMS[name]) for name in PAPER_FIGURES},
    "ph-vi-CHMM, soft start": ComparedSystem(options={"start": "soft"}, same_model_as=REFERENCE_SYSTEM),
    BEST_PATH: ComparedSystem(options={"conversion": "viterbi"}, same_model_as=REFERENCE_SYSTEM),
    "trajectory CHMM, own means": ComparedSystem(_engine("coupled", acoustic_regression=False)),
    "trajectory CHMM": ComparedSystem(_engine("coupled")),
    "trajectory HMM": ComparedSystem(_engine("trajectory")),
    BLSTM: ComparedSystem(BlstmBaseline),
    "ridge, ±150 ms": ComparedSystem(ContextRidge),
    "loudness": ComparedSystem(LoudnessRegression),
    "mean pose": ComparedSystem(MeanPose),
}
"""The systems of the table, in its order.

``best path``: means along the best path, no EM. ``own means``: no regression of the visual means on acoustic features.
"""


def selected_systems(names: Sequence[str] | None) -> list[str]:
    """Return the names of the systems to compare, in the table's order; always with ``REFERENCE_SYSTEM``.

    names : None: all systems whose packages are installed
    Raises InputError: no such system. Raises MissingDependencyError: a named system needs a package that is missing.
    """
    if names is None:
        return [name for name in COMPARED_SYSTEMS if name != BLSTM or torch_is_installed()]
    unknown = [name for name in names if name not in COMPARED_SYSTEMS]
    if unknown:
        raise InputError(f"no system {unknown[0]!r}; there are: {', '.join(COMPARED_SYSTEMS)}")
    if BLSTM in names:
        import_torch()
    return [name for name in COMPARED_SYSTEMS if name in names or name == REFERENCE_SYSTEM]


@dataclass(frozen=True, eq=False)
class TrainedSystem:
    """One trained system of the table.

    engine         : an ``Animator``
    model          : its trained model
    seconds        : training time
    mixtures       : Gaussians of its densities, where they were selected
    validation_acc : mean ACC on the validation recordings, by number of Gaussians
    """

    engine: Any
    model: Any
    seconds: float
    mixtures: int | None = None
    validation_acc: Mapping[int, float] = field(default_factory=dict)


def train_systems(
    names: Sequence[str],
    examples: Sequence[Example],
    validation: HeldOutRecordings | None,
    states: int,
    mixtures: Sequence[int],
    monitor: Monitor,
) -> dict[str, TrainedSystem]:
    """Return the trained systems by name.

    validation : recordings on which the number of Gaussians is selected; None: ``mixtures`` has one number only
    states     : per unit, in the systems of the paper
    mixtures   : numbers of Gaussians per state that these may have
    """
    trained: dict[str, TrainedSystem] = {}
    for number, name in enumerate(names):
        part = sub_monitor(monitor, number / len(names), (number + 1) / len(names), f"{name}: ")
        system = COMPARED_SYSTEMS[name]
        if system.same_model_as:
            twin = trained[system.same_model_as]
            trained[name] = replace(twin, engine=CoupledEngine(replace(twin.engine.config, **system.options)))
        elif system.make is not None:
            start_s, engine = perf_counter(), system.make()
            model = engine.fit(examples, part).model
            trained[name] = TrainedSystem(engine, model, perf_counter() - start_s)
        else:
            config = CoupledConfig(**system.options, states=states, articulation=False)
            selection = select_mixtures(examples, validation, config, mixtures, monitor=part)
            count, acc = selection.engine.config.mixtures, selection.validation_acc
            trained[name] = TrainedSystem(selection.engine, selection.model, selection.seconds, count, acc)
    return trained
