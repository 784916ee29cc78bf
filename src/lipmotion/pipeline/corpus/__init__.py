"""Recordings to a corpus: preparation, supplied motion, synchronisation, prompts."""
