"""The systems of Xie & Liu 2007, Table 3, what this project has beside them, and yardsticks."""

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
from lipmotion.experiments.baselines.recurrent import Blstm, import_torch, network_here
from lipmotion.experiments.baselines.regression import Loudness, MeanPose, SoundAround
from lipmotion.experiments.xie_liu2007.mixtures import chosen_mixtures
from lipmotion.pipeline.evaluation.evaluate import Recorded
from lipmotion.types import Example, Monitor, part_of

BEST = "ph-vi-CHMM"
"""What every other system is compared with."""
PRINTED: dict[str, tuple[float, float]] = {
    "ph-HMM": (8.043, 0.581),
    "ph-MSHMM": (8.050, 0.576),
    "ph-FHMM": (7.778, 0.593),
    "ph-vi-FHMM": (7.679, 0.608),
    "ph-CHMM": (7.239, 0.630),
    "ph-vi-CHMM": (6.911, 0.696),
}
"""AMSE and ACC of the paper's Table 3: eigenlips of another speaker, so only their order compares."""
AS_PRINTED: dict[str, Any] = {
    "conversion": "em",
    "start": "viterbi",
    "steps": 10,
    "full_range": False,
    "closures": False,
}
"""Conversion as in the paper: frame by frame, from the best path, nothing done to what comes out."""
BEST_PATH = "ph-vi-CHMM, best path"
BLSTM = "BLSTM"


@dataclass(frozen=True)
class Rival:
    """One system of the table.

    made    : gives it; None: it is the coupled engine with ``options``, and its number of Gaussians is chosen
    like    : the system whose model it takes, so that only the conversion differs, by the ``options``
    """

    made: Callable[[], Animator[Any]] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    like: str = ""


def _engine(name: str, **options: Any) -> Callable[[], Animator[Any]]:
    return lambda: engine_named(name, options)


RIVALS: dict[str, Rival] = {
    **{name: Rival(options=AS_PRINTED | SYSTEMS[name]) for name in PRINTED},
    "ph-vi-CHMM, soft start": Rival(options={"start": "soft"}, like=BEST),
    BEST_PATH: Rival(options={"conversion": "viterbi"}, like=BEST),
    "trajectory CHMM, own means": Rival(_engine("coupled", follows=False)),
    "trajectory CHMM": Rival(_engine("coupled")),
    "trajectory HMM": Rival(_engine("trajectory")),
    BLSTM: Rival(Blstm),
    "ridge, ±150 ms": Rival(SoundAround),
    "loudness": Rival(Loudness),
    "mean pose": Rival(MeanPose),
}
"""``best path``: means along it, no EM. ``own means``: the visual means do not follow what is around the frame."""


def chosen_rivals(names: Sequence[str] | None) -> list[str]:
    """Return the systems to compare, in the table's order; all that can be, by default, and always ``BEST``.

    Raises InputError: no such system. Raises MissingDependencyError: a package of one that was asked for is missing.
    """
    if names is None:
        return [name for name in RIVALS if name != BLSTM or network_here()]
    unknown = [name for name in names if name not in RIVALS]
    if unknown:
        raise InputError(f"no system {unknown[0]!r}; there are: {', '.join(RIVALS)}")
    if BLSTM in names:
        import_torch()
    return [name for name in RIVALS if name in names or name == BEST]


@dataclass(frozen=True, eq=False)
class Contender:
    """A trained rival.

    engine   : an ``Animator``
    mixtures : Gaussians of its densities, where they were chosen;  tried : mean ACC on the recordings kept aside
    """

    engine: Any
    model: Any
    seconds: float
    mixtures: int | None = None
    tried: Mapping[int, float] = field(default_factory=dict)


def trained_rivals(
    names: Sequence[str],
    examples: Sequence[Example],
    kept_aside: Recorded | None,
    states: int,
    mixtures: Sequence[int],
    monitor: Monitor,
) -> dict[str, Contender]:
    """Return systems, trained.

    kept_aside : recordings that the number of Gaussians is chosen with; None: nothing is to be chosen
    states     : per unit, of the systems of the paper;  mixtures : numbers of Gaussians that these may have
    """
    found: dict[str, Contender] = {}
    for number, name in enumerate(names):
        part = part_of(monitor, number / len(names), (number + 1) / len(names), f"{name}: ")
        rival = RIVALS[name]
        if rival.like:
            twin = found[rival.like]
            found[name] = replace(twin, engine=CoupledEngine(replace(twin.engine.config, **rival.options)))
        elif rival.made is not None:
            start_s, engine = perf_counter(), rival.made()
            model = engine.fit(examples, part).model
            found[name] = Contender(engine, model, perf_counter() - start_s)
        else:
            config = CoupledConfig(**rival.options, states=states)
            choice = chosen_mixtures(examples, kept_aside, config, mixtures, monitor=part)
            found[name] = Contender(
                choice.engine, choice.model, choice.seconds, choice.engine.config.mixtures, choice.tried
            )
    return found
