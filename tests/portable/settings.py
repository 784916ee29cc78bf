"""Environment variables that make this processor compute like others."""

import sys
from functools import cache

import children

CORES = {
    "Haswell": {"AVX2", "FMA3"}, "Zen": {"AVX2", "FMA3"}, "SkylakeX": {"AVX512_SKX"}, "Sandybridge": {"AVX"},
    "Prescott": {"SSE3"},
}  # fmt: skip
"""Values of ``OPENBLAS_CORETYPE``, the processor whose matrix products are used, and the features that these need.

Features have NumPy's names. On a processor without them a process ends at the first such instruction."""
BEFORE_AVX = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
"""A processor without AVX, also in NumPy's own loops."""
KERNELS = "from lipmotion.kernels.compiler import list_blas_kernels; print('; '.join(list_blas_kernels()))"


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
    """Return the kernels that a process actually uses with the core type ``core``; empty: with this processor's own."""
    changed = environment({"OPENBLAS_CORETYPE": core} if core else {})
    return children.run_child([sys.executable, "-c", KERNELS], variables=changed, check=True).stdout.strip()


def possible_cores() -> list[str]:
    """Return the core types whose features this processor has; ``NPY_DISABLE_CPU_FEATURES=X86_V4`` hides AVX-512."""
    import numpy as np

    features = np._core._multiarray_umath.__cpu_features__  # type: ignore[attr-defined]
    return [core for core, needed in CORES.items() if all(features.get(name) for name in needed)]


def different_cores() -> list[str]:
    """Return the possible core types without those whose kernels an earlier one, or this processor by itself has."""
    found = {kernels(core): core for core in reversed(possible_cores())} | {kernels(""): ""}
    return [core for core in possible_cores() if core in found.values()]
