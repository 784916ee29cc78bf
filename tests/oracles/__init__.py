"""Slow, readable twins of the fast code: they try everything, and share no line with what they check."""
