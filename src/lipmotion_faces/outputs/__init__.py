"""Outputs that show a face: videos, pictures, scenes."""
