"""Principal components of many pictures, compared with scikit-learn's randomised ones if it is installed.

    python benchmarks/pca.py [--rows 20000] [--columns 7200] [--components 90] [--threads 1]

Prints one JSON object per implementation: processor seconds, growth of the largest resident size of its process beyond
the data, and the share of the variance that the components explain.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
from importlib import util
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray


def main() -> None:
    """Print the figures of each implementation."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, default in (("rows", 20_000), ("columns", 7200), ("components", 90), ("threads", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--only", help="one implementation, in this process: lipmotion or sklearn")
    options = parser.parse_args()
    if options.only:
        measure(options.only, options.rows, options.columns, options.components)
        return
    environment = os.environ | {"OMP_NUM_THREADS": str(options.threads), "OPENBLAS_NUM_THREADS": str(options.threads)}
    for name in ("lipmotion", *(["sklearn"] if util.find_spec("sklearn") else [])):
        subprocess.run([sys.executable, *sys.argv, "--only", name], env=environment, check=True)


def measure(name: str, rows: int, columns: int, components: int) -> None:
    """Print the figures of one implementation."""
    draw = np.random.default_rng(0)
    values = draw.standard_normal((rows, columns), np.float32)
    values *= 0.5
    scales = (100 * 0.96 ** np.arange(120)).astype(np.float32)
    smooth = np.cumsum(np.cumsum(draw.standard_normal((120, columns), np.float32), axis=1), axis=1)
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    for start in range(0, rows, 1000):  # a block at a time, so that the peak before is that of the data
        block = values[start : start + 1000]
        block += (draw.standard_normal((len(block), 120), np.float32) * scales) @ smooth
    fit(name, values[:2000, :400], 5)  # modules are loaded
    before, start_s = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, process_time()
    basis = fit(name, values, components)
    seconds, grown = process_time() - start_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    some = values[::5] - values.mean(axis=0)
    share = float(np.square(some @ basis.astype(np.float32).T).sum(dtype=float) / np.square(some).sum(dtype=float))
    print(json.dumps({"what": name, "cpu_s": round(seconds, 2), "mb": round(grown / 1e3), "share": round(share, 6)}))


def fit(name: str, values: NDArray[np.float32], components: int) -> NDArray[Any]:
    """Return the components [shape=(components, columns)]."""
    if name == "sklearn":
        from sklearn.decomposition import PCA

        return PCA(components, svd_solver="randomized", random_state=0).fit(values).components_
    from lipmotion.stats.pca import fit_pca

    return fit_pca(values, components).basis


if __name__ == "__main__":
    main()
