"""The joint engine: one model of speech, F0 and motion (Hofer 2008)."""
