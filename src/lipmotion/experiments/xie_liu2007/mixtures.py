"""The number of Gaussians per state of coupled chains, selected on validation recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

from lipmotion.engines import Fit
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.engines.coupled.training.fit import growing_models
from lipmotion.errors import InputError
from lipmotion.experiments.comparison import correlation_statistic
from lipmotion.pipeline.evaluation.conditions import AUDIO_ONLY, HeldOutRecordings, compared_clips
from lipmotion.types import Example, Monitor, silent_monitor

MIXTURE_COUNTS = (1, 2, 4, 8)


@dataclass(frozen=True, eq=False)
class MixtureSelection:
    """A trained model with the selected number of Gaussians.

    engine, model  : with that number in all densities
    seconds        : training time up to this model, without that of larger ones
    validation_acc : mean ACC on the validation recordings, by number of Gaussians
    """

    engine: CoupledEngine
    model: CoupledModel
    seconds: float
    validation_acc: dict[int, float]


def select_mixtures(
    examples: Sequence[Example],
    validation: HeldOutRecordings | None,
    config: CoupledConfig,
    counts: Sequence[int] = MIXTURE_COUNTS,
    condition: str = AUDIO_ONLY,
    monitor: Monitor = silent_monitor,
) -> MixtureSelection:
    """Return coupled chains with the number of Gaussians whose mean ACC on validation recordings is highest.

    validation : recordings of ``pipeline.evaluation``, not among the examples; None: ``counts`` has one number only
    config     : all other options; all densities have the same number of Gaussians
    counts     : numbers to select from, powers of two; a single one is taken without evaluation
    condition  : whether the chains know the transcript (``with transcript``) or not (``audio only``)
    The smaller models are stages of the training of the largest. Among equals, the smallest is selected.
    Source: Xie & Liu 2007, §7.1.
    Raises InputError: no number, or one that is no power of two. Raises as ``Engine.fit``.
    """
    check_mixture_counts(counts)
    if validation is None and len(counts) > 1:
        raise InputError(f"{len(counts)} numbers of Gaussians and no recordings to choose with; give one number")
    most = max(counts)
    validation_acc: dict[int, float] = {}
    best: tuple[int, CoupledModel, float] | None = None
    for count, make_model, seconds in _stages(examples, _with_mixtures(config, most), monitor):
        if count not in counts:
            continue
        model = make_model().model
        if validation is not None:
            engine = CoupledEngine(_with_mixtures(config, count))
            validation_acc[count] = _mean_acc(validation, condition, engine, model)
        if best is None or validation_acc[count] > validation_acc[best[0]]:
            best = count, model, seconds
    if best is None:
        raise InputError("no trained chains have as many Gaussians as were asked for")
    count, model, seconds = best
    return MixtureSelection(CoupledEngine(_with_mixtures(config, count)), model, seconds, validation_acc)


def check_mixture_counts(counts: Sequence[int]) -> None:
    """Raise InputError unless there are some numbers, all of them powers of two."""
    if not counts or any(count < 1 or count & (count - 1) for count in counts):
        given = ", ".join(map(str, counts)) or "none"
        raise InputError(f"numbers of Gaussians {given}; required: powers of two, as 1,2,4,8")


def _with_mixtures(config: CoupledConfig, count: int) -> CoupledConfig:
    return replace(config, mixtures=count, visual_mixtures=count)


def _stages(
    examples: Sequence[Example], config: CoupledConfig, monitor: Monitor
) -> Iterator[tuple[int, Callable[[], Fit[CoupledModel]], float]]:
    """Yield, for each stage of training, the number of Gaussians, a function that returns the model, and the seconds.

    The seconds are those of all training up to this stage.
    """
    seconds, start_s, count = 0.0, perf_counter(), 1
    for make_model in growing_models(examples, config, monitor):
        seconds += perf_counter() - start_s
        yield count, make_model, seconds
        start_s, count = perf_counter(), 2 * count


def _mean_acc(validation: HeldOutRecordings, condition: str, engine: CoupledEngine, model: CoupledModel) -> float:
    """Return the mean ACC over channels of what a model generates for validation recordings."""
    made = compared_clips(validation, condition, engine, model)
    return correlation_statistic([clip.generated for clip in made], [clip.original for clip in made]).value
