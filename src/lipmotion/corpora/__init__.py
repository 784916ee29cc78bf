"""Recordings in, and the corpus they become."""
