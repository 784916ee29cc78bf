"""Verbs of the command line of experiments and comparisons."""
