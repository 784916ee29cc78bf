"""Add-ons that run inside other programs: nothing of lipmotion imports them, they are written to files."""
