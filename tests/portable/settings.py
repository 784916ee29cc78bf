"""Other processors, as far as this one can pretend to be them."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache

CORES = ("Haswell", "Zen", "SkylakeX", "Sandybridge", "Prescott")
"""Values of ``OPENBLAS_CORETYPE``: the processor whose matrix products are used."""
BEFORE_AVX = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
"""A processor of 2004, NumPy's own loops included."""
KERNELS = "from lipmotion.kernels.threads import blas_kernels; print('; '.join(blas_kernels()))"


def environment(changes: dict[str, str]) -> dict[str, str]:
    """Return the variables of a process with these changes. What NumPy cannot switch off it is not asked to."""
    import numpy as np

    known = set(np._core._multiarray_umath.__cpu_dispatch__)
    changes = dict(changes)
    if wanted := changes.get("NPY_DISABLE_CPU_FEATURES"):
        changes["NPY_DISABLE_CPU_FEATURES"] = " ".join(name for name in wanted.split() if name in known)
    return {name: value for name, value in os.environ.items() if not name.startswith("OPENBLAS_")} | changes


@cache
def kernels(core: str) -> str:
    """Return the kernels that a process really uses when it is told to use those of ``core``."""
    found = subprocess.run(
        [sys.executable, "-c", KERNELS],
        env=environment({"OPENBLAS_CORETYPE": core}),
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    return found.stdout.strip()


def different_cores() -> dict[str, str]:
    """Return the kernels of every core type that are not those of an earlier one: a build may hold few of them."""
    found: dict[str, str] = {}
    for core in CORES:
        if kernels(core) not in found.values():
            found[core] = kernels(core)
    return found
