"""Recordings to phones and words in time, and to the input of engines."""
