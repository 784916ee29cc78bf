"""A model and held-out recordings to figures."""
