"""A fuzzer for all file readers of lipmotion: ``python -m fuzz`` with ``tests`` in PYTHONPATH, or ``make fuzz``."""
