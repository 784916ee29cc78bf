"""Experiments: train and compare systems on a corpus, for tables like those of the papers."""
