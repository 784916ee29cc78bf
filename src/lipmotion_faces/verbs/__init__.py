"""Verbs of the command line that need faces or tracking."""
