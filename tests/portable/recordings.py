"""``python -m portable.recordings FILE ...``: compare the shipped model on this processor and on one without AVX."""

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import lipmotion
from children import run_child
from portable.settings import BEFORE_AVX, environment


def compute(output: str, recordings: Sequence[str]) -> None:
    """Write motion and phones of all recordings, audio only, as arrays."""
    made = [(name, lipmotion.animate(name)) for name in recordings]
    motion = {f"motion {name}": result.motion.values for name, result in made}
    phones = {f"phones {name}": np.array([span.label.phone for span in result.units]) for name, result in made}
    np.savez(output, **motion, **phones)


def compare(recordings: Sequence[str]) -> None:
    """Print how many phones and how far the motion differ."""
    with TemporaryDirectory() as folder:
        paths = [Path(folder) / "here.npz", Path(folder) / "there.npz"]
        for path, changes in zip(paths, ({}, BEFORE_AVX), strict=True):
            command = [sys.executable, __file__, "--compute", str(path), *recordings]
            run_child(command, variables=environment(changes), check=True, limit_s=3600)
        here, there = (dict(np.load(path, allow_pickle=False)) for path in paths)
    differing = [name for name in here if name.startswith("phones") and here[name].tolist() != there[name].tolist()]
    largest = max(float(np.abs(here[name] - there[name]).max()) for name in here if name.startswith("motion"))
    print(f"{len(recordings)} recordings, {len(differing)} with other phones, motion differs by up to {largest:.1e}")
    print("\n".join(differing))


if __name__ == "__main__":
    if sys.argv[1] == "--compute":
        compute(sys.argv[2], sys.argv[3:])
    else:
        compare(sys.argv[1:])
