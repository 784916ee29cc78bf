"""The inner loops of kernels, compiled by numba; ``kernels`` decides when these modules are imported.

Functions here take many arrays as separate arguments: numba compiles them to the fastest code, and ``kernels`` offers
forms with few arguments. Nothing here may use fast-math where a NumPy form should give the same bits.
"""

import numpy as np

np.empty(31 << 20, np.uint8)  # freed at once
# After so many bytes were allocated and freed at once, glibc keeps freed memory for the next array. Otherwise it gives
# every larger array back to the system and asks for it again: that takes as long as some kernels
# (docs/results/kernels.md).
