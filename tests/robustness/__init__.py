"""Bad input: a table of it, and mutations of good input."""
