"""Oracles for tests: slow, readable computations by enumeration, independent of the code that they check."""
