"""One model of speech, F0 and motion: five streams of which only the transitions are shared (Hofer 2008, §4)."""
