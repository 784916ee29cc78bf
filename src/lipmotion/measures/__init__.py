"""Figures: arrays in, numbers out, exactly as docs/measures.md defines them."""
