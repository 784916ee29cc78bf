"""A fuzzer for everything that lipmotion reads: ``python -m fuzz`` in this folder's parent, or ``make fuzz``."""
