"""Filmed faces: built from footage of a person, and animated over it."""
