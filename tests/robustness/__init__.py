"""Bad input: a table of cases, each of which is a test."""
