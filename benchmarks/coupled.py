"""Speed of coupled models of speech and motion compared with peers, in the harness of the peers.

    python benchmarks/coupled.py --bench ../shared/bench [--rounds 3]

Forward–backward with posteriors and counts for two models: 47 phones whose audio and visual states (5 each) may be one
state apart, with 611 product states; and two phone loops that share only the emission, with 235 × 65 (the prototype
has no counts) and 235 × 235 states. Work per CPU second of one thread, over rounds in which all take turns: median and
best. Peers that cannot be
imported are left out (pip install hmmlearn dynamax psutil threadpoolctl).
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from kernels import Work, run

RUNS = {
    "constrained, ours": ("coupled:constrained", "numba", ("--repeats", "5")),
    "constrained, ours, double precision": ("coupled:constrained_double", "numba", ("--repeats", "5")),
    "constrained, prototype": ("constrained", "threadpoolctl", ("--repeats", "5")),
    "constrained, hmmlearn": ("hmmlearn_flat", "hmmlearn", ("--repeats", "1", "--utts", "2")),
    "constrained, dynamax": ("dynamax_flat", "dynamax", ("--repeats", "2")),
    "factorial 235 x 65, ours": ("coupled:factorial", "numba", ("--repeats", "3", "--utts", "4")),
    "factorial 235 x 65, prototype": ("frontier_fhmm", "numba", ("--repeats", "3", "--utts", "4")),
    "factorial 235 x 235, ours": ("coupled:factorial_wide", "numba", ("--repeats", "3", "--utts", "4")),
}


def constrained(options: Any, kind: type = np.float32) -> Work:
    """Return the work: posteriors and counts of the constrained product, from log densities of both chains."""
    from lipmotion.kernels.network import ForwardBackwardNetwork

    harness: Any = sys.modules["__main__"]
    transition, initial, audio, visual = harness.flat()
    by_pair = np.arange(len(initial)).reshape(harness.P, harness.J).T.ravel()
    transition, initial, audio, visual = (
        transition[np.ix_(by_pair, by_pair)],
        *(part[by_pair] for part in (initial, audio, visual)),
    )
    targets, sources = np.nonzero(transition.T)
    with np.errstate(divide="ignore"):
        expectation = ForwardBackwardNetwork.of(
            sources, np.log(transition[sources, targets]), np.searchsorted(targets, np.arange(len(initial))),
            np.log(initial), np.zeros(len(initial)),
        )  # fmt: skip
    columns = [column[expectation.layout.order] for column in (audio, visual)]
    logs = [np.log(part).reshape(-1, part.shape[-1]).astype(kind) for part in harness.lik(options)]
    frames = np.full(options.utts, options.T)
    return lambda: float(expectation.product_posteriors(logs, columns, frames).log_likelihood.sum())


def constrained_double(options: Any) -> Work:
    """Return the same work in double precision."""
    return constrained(options, np.float64)


def factorial(options: Any, visual_units: int = 13) -> Work:
    """Return the work: posteriors and counts of two loops."""
    import numba  # noqa: F401

    from lipmotion.kernels.factorial import factorial_posteriors
    from lipmotion.kernels.factorial_loops import FactorialLogLikelihoods, Loop

    draw = np.random.default_rng(0)

    def loop(units: int) -> Loop:
        enter, equal = draw.dirichlet(np.ones(units), size=units), np.full((5, units), 1 / (5 * units))
        return Loop(*(np.full(shape, p) for shape, p in (((5, units), 0.8), ((4, units), 0.2), (units, 0.2))),
                    enter, equal, np.ones((5, units)))  # fmt: skip

    loops = loop(47), loop(visual_units)
    size = options.utts, options.T
    logs = [-draw.gamma(2.0, 1.5, size=(*size, part.stay.size)).astype(np.float32) for part in loops]
    recordings = [FactorialLogLikelihoods.of(audio, visual) for audio, visual in zip(*logs, strict=True)]
    return lambda: sum(factorial_posteriors(*loops, recording).log_likelihood for recording in recordings)


def factorial_wide(options: Any) -> Work:
    """Return the same work with 47 units in each loop."""
    return factorial(options, 47)


def main() -> None:
    """Print one JSON object for each implementation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bench", type=Path, default=Path("../shared/bench"))
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    wanted = {name: case for name, case in RUNS.items() if find_spec(case[1])}
    rates: dict[str, list[float]] = {name: [] for name in wanted}
    checks = {}
    for _ in range(options.rounds):
        for name, (implementation, _, flags) in wanted.items():
            row = run(options.bench / "bench_chmm.py", implementation, flags)
            rates[name].append(row["work"] / row["cpu_sec_median"])
            checks[name] = row["check"]
    ours = rates["constrained, ours"]
    for name, found in rates.items():
        figures = {"frames per CPU second, median": round(statistics.median(found)), "best": round(max(found))}
        if name.startswith("constrained"):
            figures["ours are times as many"] = round(statistics.median(ours) / statistics.median(found), 1)
        print(json.dumps({"figure": name} | figures | {"check": checks[name]}), flush=True)


if __name__ == "__main__":
    main()
