"""The inner loops, compiled: the same arrays in and out as in ``kernels``, which decides when these are imported.

Nothing here may use fast-math where a NumPy form should give the same bits.
"""
