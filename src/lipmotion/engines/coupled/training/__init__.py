"""Training of coupled chains from speech with motion, and from speech alone."""
