"""A corpus and engines to the tables of the papers."""
