"""Training: a corpus to a model."""
