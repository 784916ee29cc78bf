"""Hidden Markov models of units: flat start, embedded training, alignment, decoding."""
