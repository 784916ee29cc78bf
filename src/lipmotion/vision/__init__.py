"""Video in, motion out."""
