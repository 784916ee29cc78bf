"""The inner loops, compiled: the same arrays in and out as in ``kernels``, which decides when these are imported.

Nothing here may use fast-math where a NumPy form should give the same bits.
"""

import numpy as np

np.empty(31 << 20, np.uint8)  # freed at once
# Once so many bytes were asked for and freed, glibc keeps what is freed for the next array. Else every array of some
# size is returned to the system and asked for again, which takes as long as some kernels do (docs/results/kernels.md).
