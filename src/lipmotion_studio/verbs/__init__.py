"""Verbs of the command line of the studio and the studies."""
