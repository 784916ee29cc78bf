"""Phones and words in time: forced alignment, recognition, adaptation."""
