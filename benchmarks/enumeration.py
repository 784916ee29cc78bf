"""Recursions over state paths against the enumeration of all paths, where densities and probabilities are extreme.

    python benchmarks/enumeration.py [--cases 1000] [--only NAME ...]

For every recursion and spread of log densities (nats): how many of the random cases were wrong, and in brackets how
many were computed in logarithms. Cases are normal, have ties or states that take turns, and -inf; every other case has
arcs, beginnings and ends down to e^-1000 or forbidden (``tests/kernels/extremes.py``). Tolerances are those of
``tests/kernels/enumeration.py``. The numbers of cases that were wrong go to standard error.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from kernels.enumeration import RECURSIONS, SPREADS, is_right
from lipmotion.kernels import factorial, network

in_logs = [0]


def counted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that counts its calls in ``in_logs``."""

    def counting(*arguments: Any) -> Any:
        in_logs[0] += 1
        return function(*arguments)

    return counting


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--only", nargs="*", default=list(RECURSIONS), choices=list(RECURSIONS))
    options = parser.parse_args()
    network.ForwardBackwardNetwork._in_logs = counted(network.ForwardBackwardNetwork._in_logs)  # type: ignore[method-assign]
    factorial._InLogs = counted(factorial._InLogs)  # type: ignore[misc]
    print("| recursion | " + " | ".join(f"{spread:g}" for spread in SPREADS) + " |")
    print("|---" * (1 + len(SPREADS)) + "|")
    for name in options.only:
        cells = []
        for spread in SPREADS:
            in_logs[0] = 0
            wrong = [number for number in range(options.cases) if not is_right(name, spread, number)]
            cells.append(f"{len(wrong)} ({in_logs[0]})")
            if wrong:
                print(f"{name}, {spread:g}: wrong {wrong[:8]}", file=sys.stderr)
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
