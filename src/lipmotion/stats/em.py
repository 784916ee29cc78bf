"""Expectation–maximisation: the loop that training and EM conversion share, and its E-step over shards of the data."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from itertools import islice
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.archive import Checkpoint

ModelT = TypeVar("ModelT")
ShardT = TypeVar("ShardT")
Sums = Mapping[str, NDArray[Any]]
"""Sufficient statistics by name: arrays whose values for all data are the sums of those for its parts."""
SAVE_S = 10.0  # a longer E-step is stored so often, and at its end


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
    min_gain: float = -np.inf,
    maximise_converged: bool = True,
) -> EmResult[ModelT, StatisticsT]:
    """Improve a model by expectation–maximisation (EM).

    expect     : the E-step: returns the sufficient statistics of the data under a model
    maximise   : the M-step: returns the model that the statistics make most likely
    max_steps : stop after so many steps, 1 or more
    after_step : is called after every step with its number (from 1), the new model, and the statistics of the step
    min_gain : stop at the first step whose E-step finds a mean log likelihood per frame that is higher by less than
                 this than that of the step before; -inf: always take ``max_steps`` steps
    maximise_converged : whether the step at which EM stops for want of gain has an M-step, and is reported
    Source: Dempster, Laird & Rubin 1977.
    """
    log_likelihoods: list[float] = []
    for step in range(1, max_steps + 1):
        statistics = expect(model)
        log_likelihoods.append(statistics.mean_log_likelihood)
        converged = step > 1 and log_likelihoods[-1] - log_likelihoods[-2] < min_gain
        if not converged or maximise_converged:
            model = maximise(model, statistics)
            after_step(step, model, statistics)
        if converged:
            break
    return EmResult(model, statistics, tuple(log_likelihoods), bool(converged))


def sum_statistics(
    expect: Callable[[tuple[ModelT, ShardT]], Sums], model: ModelT, shards: Sequence[ShardT], work: Checkpoint
) -> Sums:
    """Return the sufficient statistics of all shards under a model (the E-step); without shards, none.

    expect : a module's function of the model and one shard, which any process may call
    work   : distributes the shards; its folder keeps what is summed so far, by a digest of model and shards
    The sum is in the order of the shards: the same to the bit, whoever computes them.
    """
    stage = f"sum-{_digest((expect.__qualname__, model, shards))}" if work.folder is not None else ""
    total = dict(work.load(stage) or {}) if stage else {}
    done = int(total.pop(_DONE, 0))
    begun_s = saved_s = time.monotonic()
    jobs = ((model, shard) for shard in islice(shards, done, None))
    for number, sums in enumerate(work.parallel_map(expect, jobs), start=done + 1):
        if total:
            for name, values in sums.items():
                total[name] = total[name] + values
        else:
            total = dict(sums)
        now_s = time.monotonic()
        if stage and now_s - (begun_s if number == len(shards) else saved_s) >= SAVE_S:
            work.save(stage, {**total, _DONE: np.array(number)})
            saved_s = now_s
    return total


_DONE = "shards done"


def _digest(value: object) -> str:
    digest = hashlib.blake2b(digest_size=16)

    def add(value: Any) -> None:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype} {value.shape}".encode())
            digest.update(np.ascontiguousarray(value).data)
        elif is_dataclass(value):
            for field in fields(value):
                add(getattr(value, field.name))
        elif isinstance(value, Mapping):
            add(list(value.items()))
        elif isinstance(value, list | tuple):
            for each in value:
                add(each)
        else:
            digest.update(repr(sorted(value) if isinstance(value, frozenset) else value).encode())

    add(value)
    return digest.hexdigest()
