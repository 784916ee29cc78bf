"""Sentences in the voices of speech synthesisers that are installed, with the time of every phone."""
