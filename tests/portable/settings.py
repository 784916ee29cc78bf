"""Environment variables that make this processor compute like others."""

from __future__ import annotations

import sys
from functools import cache

import children

CORES = ("Haswell", "Zen", "SkylakeX", "Sandybridge", "Prescott")
"""Values of ``OPENBLAS_CORETYPE``: the processor whose matrix products are used."""
BEFORE_AVX = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
"""A processor without AVX, also in NumPy's own loops."""
KERNELS = "from lipmotion.kernels.threads import blas_kernels; print('; '.join(blas_kernels()))"


def environment(changes: dict[str, str]) -> dict[str, str]:
    """Return the environment of a process with changes; processor features unknown to NumPy are left out of them."""
    import numpy as np

    known = set(np._core._multiarray_umath.__cpu_dispatch__)  # type: ignore[attr-defined]
    changes = dict(changes)
    if wanted := changes.get("NPY_DISABLE_CPU_FEATURES"):
        changes["NPY_DISABLE_CPU_FEATURES"] = " ".join(name for name in wanted.split() if name in known)
    return {name: value for name, value in children.environment().items() if not name.startswith("OPENBLAS_")} | changes


@cache
def kernels(core: str) -> str:
    """Return the kernels that a process actually uses with the core type ``core``."""
    changed = environment({"OPENBLAS_CORETYPE": core})
    return children.run_child([sys.executable, "-c", KERNELS], variables=changed, check=True).stdout.strip()


def different_cores() -> dict[str, str]:
    """Return the kernels of the core types, without repetitions: a build may contain few of them."""
    found: dict[str, str] = {}
    for core in CORES:
        if kernels(core) not in found.values():
            found[core] = kernels(core)
    return found
