"""Speed of the compiled kernels compared with peers, in the harness of the peers.

    python benchmarks/kernels.py --bench ../shared/bench [--rounds 3] [--only NAME ...]

Each figure is work per CPU second of one thread, over rounds in which this package and the peer take turns: the median
and the best round. Other processes slow both down, short runs most; so the ratio is compared. Peers
that cannot be imported are left out (pip install hmmlearn nnmnkwii librosa psutil).
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

HERE = Path(__file__).resolve().parent
Work = Callable[[], Any]


class PeerComparison(NamedTuple):
    """One comparison: script of the harness, factory of this package, the peer and its package, options of both."""

    script: str
    ours: str
    peer: str
    package: str
    options: tuple[str, ...] = ()


LOOP = ("--utts", "100", "--repeats", "3")
SHORT_LOOP = ("--utts", "10", "--repeats", "2", "--K", "8")
CASES = {
    "parameter generation, D=90": PeerComparison("bench_mlpg.py", "mlpg", "nnmnkwii", "nnmnkwii", ("--repeats", "15")),
    "EM, K=1": PeerComparison("bench_hmm.py", "em", "hmmlearn_scaling", "hmmlearn", (*LOOP, "--op", "em")),
    "EM, K=8": PeerComparison("bench_hmm.py", "em", "hmmlearn_scaling", "hmmlearn", (*SHORT_LOOP, "--op", "em")),
    "Viterbi, K=1": PeerComparison(
        "bench_hmm.py", "viterbi", "hmmlearn_scaling", "hmmlearn", (*LOOP, "--op", "viterbi")
    ),
    "MFCC": PeerComparison("bench_mfcc.py", "features", "librosa", "librosa", ("--minutes", "10")),
    "cloning": PeerComparison("bench_poisson.py", "cloning", "cv2_seamlessClone", "cv2"),
}


def mlpg(options: Any) -> Work:
    """Return the work: trajectory and variance of every frame (the peers compute no variance)."""
    import numba  # noqa: F401  (loaded: so the compiled form is taken at once)

    from lipmotion.kernels.banded import solve_mlpg

    mean, precision = (np.ascontiguousarray(a.transpose(1, 0, 2)) for a in _harness("get")(options))
    return lambda: solve_mlpg(mean, precision)[0]


def em(options: Any) -> Work:
    """Return the work: one EM step on all recordings."""
    from network_em import em_step

    mixtures, network, data = _loop(options)
    floor = np.full(options.D, 1e-3, np.float32)

    def step() -> tuple[float]:
        return (em_step(mixtures, network, data, floor)[2] * options.T * options.utts,)

    return step


def viterbi(options: Any) -> Work:
    """Return the work: densities and best path of every recording."""
    import numba  # noqa: F401

    from lipmotion.kernels.paths import best_path

    mixtures, network, data = _loop(options)

    def decode() -> tuple[float]:
        total = 0.0
        for x in data:
            density = mixtures.log_likelihood(x)
            total += best_path(lambda a, b, density=density: density[a:b], len(x), network.arrays)[1]
        return (total,)

    return decode


def features(options: Any) -> Work:
    """Return the work: 39 features of every frame, normalised (the peers do not)."""
    from lipmotion.speech.features.mfcc import mfcc
    from lipmotion.types import Audio

    audio = Audio(_harness("audio")(options).astype(np.float32) / 32768, 16_000)
    return lambda: mfcc(audio).values


def cloning(options: Any) -> Work:
    """Return the work: a patch in every frame, with its gradient and the frame's edge."""
    from lipmotion_faces.appearance.poisson import build_cloning_system

    pictures, size = _harness("get")(options), options.size
    top, left = pictures["y"], pictures["x"]
    frames = np.stack(pictures["fr"] * 2)
    source, mask = frames.copy(), np.zeros(frames.shape[1:3], bool)
    source[:, top : top + size, left : left + size] = np.stack(pictures["pa"] * 2)
    mask[top + 1 : top + size - 1, left + 1 : left + size - 1] = True
    system = build_cloning_system(mask)
    return lambda: system.clone(source, frames)[-1]


def _harness(name: str) -> Any:
    return getattr(sys.modules["__main__"], name)


def _loop(options: Any) -> tuple[Any, Any, list[np.ndarray]]:
    """Return the model of the harness as mixtures and network, and its recordings."""
    from lipmotion.hmm.network import NetworkBuilder
    from lipmotion.stats.mixture import Mixtures

    model, data = _harness("get")(options)
    builder = NetworkBuilder()
    for state, stay in enumerate(np.diag(model["A"])):
        builder.state(state, float(np.log(stay)))
        builder.final[state] = 0.0
    for source, target in zip(*np.nonzero(model["A"]), strict=True):
        if source != target:
            builder.arc(int(source), int(target), float(np.log(model["A"][source, target])))
    for state in np.flatnonzero(model["pi"]):
        builder.initial[int(state)] = float(np.log(model["pi"][state]))
    values = (np.log(model["w"]), model["mu"], model["var"])
    return Mixtures(*(v.astype(np.float32) for v in values)), builder.build(), list(data.astype(np.float32))


def main() -> None:
    """Print one JSON object per comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bench", type=Path, default=Path("../shared/bench"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="*", default=list(CASES), choices=list(CASES))
    options = parser.parse_args()
    for name in options.only:
        print(json.dumps({"figure": name} | compared(options.bench, CASES[name], options.rounds)), flush=True)


def compared(bench: Path, case: PeerComparison, rounds: int) -> dict[str, Any]:
    """Return work per CPU second of this package and of the peer, and the check values of the harness."""
    implementations = {"ours": f"kernels:{case.ours}"}
    if find_spec(case.package):
        implementations[case.peer] = case.peer
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in implementations}
    for _ in range(rounds):
        for name, implementation in implementations.items():
            rows[name].append(run(bench / case.script, implementation, case.options))
    result: dict[str, Any] = {}
    for kind, choose in (("median", statistics.median), ("best", max)):
        rates = {name: choose([r["work"] / r["cpu_sec_median"] for r in found]) for name, found in rows.items()}
        result |= {f"{name}, per CPU second, {kind}": round(rate) for name, rate in rates.items()}
        if case.peer in rates:
            result[f"ratio, {kind}"] = round(rates["ours"] / rates[case.peer], 1)
    return result | {f"{name}, check": found[0]["check"] for name, found in rows.items()}


def run(script: Path, implementation: str, options: tuple[str, ...]) -> dict[str, Any]:
    """Run one implementation in the harness, on one thread."""
    paths = os.pathsep.join([str(HERE), str(HERE.parent / "src"), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, str(script), "--impl", implementation, "--threads", "1", *options]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": paths}, check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
