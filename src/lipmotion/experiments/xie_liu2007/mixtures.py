"""How many Gaussians a state of coupled chains should have: as many as are best on recordings kept aside."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.engines.coupled.training.fit import growing_models
from lipmotion.errors import InputError
from lipmotion.experiments.comparison import correlation_tally
from lipmotion.pipeline.evaluation.evaluate import Recorded, clips
from lipmotion.types import Example, Monitor, silent_monitor

CANDIDATES = (1, 2, 4, 8)


@dataclass(frozen=True, eq=False)
class Choice:
    """A model with the number of Gaussians that was best.

    engine, model : with that number in all densities
    seconds       : of the training of this model, and of no larger one
    tried         : the mean ACC on the recordings kept aside, by the number of Gaussians
    """

    engine: CoupledEngine
    model: CoupledModel
    seconds: float
    tried: dict[int, float]


def chosen_mixtures(
    examples: Sequence[Example],
    kept_aside: Recorded | None,
    config: CoupledConfig,
    candidates: Sequence[int] = CANDIDATES,
    condition: str = "audio only",
    monitor: Monitor = silent_monitor,
) -> Choice:
    """Return coupled chains with the number of Gaussians whose mean ACC on recordings kept aside is highest.

    kept_aside : the recordings, of ``pipeline.evaluate.recorded``, not among the examples; None: one candidate only
    config     : of everything else; all densities have the same number
    candidates : powers of two; one of them alone is taken without being tried
    condition  : what the chains are told of what is said
    All are models on the way to the largest. Of equals, the smallest is taken.
    Source: Xie & Liu 2007, §7.1.
    Raises InputError: no candidate, or one that is no power of two. Raises as ``Engine.fit``.
    """
    check_numbers(candidates)
    if kept_aside is None and len(candidates) > 1:
        raise InputError(f"{len(candidates)} numbers of Gaussians and no recordings to choose with; give one number")
    most = max(candidates)
    tried: dict[int, float] = {}
    best: tuple[int, CoupledModel, float] | None = None
    for number, made, seconds in _grown(examples, _with(config, most), monitor):
        if number not in candidates:
            continue
        model = made()
        if kept_aside is not None:
            engine = CoupledEngine(_with(config, number))
            tried[number] = _acc(kept_aside, condition, engine, model)
        if best is None or tried[number] > tried[best[0]]:
            best = number, model, seconds
    if best is None:
        raise InputError("chains with as many Gaussians as were asked for did not come about")
    number, model, seconds = best
    return Choice(CoupledEngine(_with(config, number)), model, seconds, tried)


def check_numbers(candidates: Sequence[int]) -> None:
    """Raise InputError unless there are some numbers, all of them powers of two."""
    if not candidates or any(number < 1 or number & (number - 1) for number in candidates):
        found = ", ".join(map(str, candidates)) or "none"
        raise InputError(f"numbers of Gaussians {found}; required: powers of two, as 1,2,4,8")


def _with(config: CoupledConfig, number: int) -> CoupledConfig:
    return replace(config, mixtures=number, visual_mixtures=number)


def _grown(
    examples: Sequence[Example], config: CoupledConfig, monitor: Monitor
) -> Iterator[tuple[int, Callable[[], CoupledModel], float]]:
    """Give the number of Gaussians, what makes the model, and the seconds of training so far."""
    seconds, start_s, number = 0.0, perf_counter(), 1
    for made in growing_models(examples, config, monitor):
        seconds += perf_counter() - start_s
        yield number, made, seconds
        start_s, number = perf_counter(), 2 * number


def _acc(kept_aside: Recorded, condition: str, engine: CoupledEngine, model: CoupledModel) -> float:
    made = clips(kept_aside, condition, engine, model)
    return correlation_tally([clip.generated for clip in made], [clip.original for clip in made]).value
