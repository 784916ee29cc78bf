"""Speech of installed synthesisers, with the time of every phone."""
