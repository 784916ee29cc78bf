"""Expectation–maximisation: the loop that all trainers of the package share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

ModelT = TypeVar("ModelT")


class ExpectedStatistics(Protocol):
    """What an E-step returns: the sufficient statistics of the data under a model."""

    @property
    def mean_log_likelihood(self) -> float:
        """Mean log likelihood per frame under the model that the statistics were accumulated with."""


StatisticsT = TypeVar("StatisticsT", bound=ExpectedStatistics)


@dataclass(frozen=True, eq=False)
class EmResult(Generic[ModelT, StatisticsT]):
    """The outcome of expectation–maximisation.

    model           : the model after the last M-step
    statistics      : the statistics of the last E-step
    log_likelihoods : mean log likelihood per frame at every E-step
    converged       : whether EM ended for want of gain; False: after the greatest number of steps
    """

    model: ModelT
    statistics: StatisticsT
    log_likelihoods: tuple[float, ...]
    converged: bool


def no_report(step: int, model: object, statistics: object) -> None:
    """Report nothing after a step."""


def run_em(
    model: ModelT,
    expect: Callable[[ModelT], StatisticsT],
    maximise: Callable[[ModelT, StatisticsT], ModelT],
    max_steps: int,
    after_step: Callable[[int, ModelT, StatisticsT], None] = no_report,
    *,
    least_gain: float = -np.inf,
    maximise_converged: bool = True,
) -> EmResult[ModelT, StatisticsT]:
    """Improve a model by expectation–maximisation (EM).

    expect     : the E-step: returns the sufficient statistics of the data under a model
    maximise   : the M-step: returns the model that the statistics make most likely
    max_steps : stop after so many steps, 1 or more
    after_step : is called after every step with its number (from 1), the new model, and the statistics of the step
    least_gain : stop at the first step whose E-step finds a mean log likelihood per frame that is higher by less than
                 this than that of the step before; -inf: always take ``max_steps`` steps
    maximise_converged : whether the step at which EM stops for want of gain still has its M-step; without it, that step
                 is not reported to ``after_step``
    Source: Dempster, Laird & Rubin 1977.
    """
    log_likelihoods: list[float] = []
    for step in range(1, max_steps + 1):
        statistics = expect(model)
        log_likelihoods.append(statistics.mean_log_likelihood)
        converged = step > 1 and log_likelihoods[-1] - log_likelihoods[-2] < least_gain
        if not converged or maximise_converged:
            model = maximise(model, statistics)
            after_step(step, model, statistics)
        if converged:
            break
    return EmResult(model, statistics, tuple(log_likelihoods), bool(converged))
