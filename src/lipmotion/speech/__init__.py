"""Sound in: reading, features, forced alignment and recognition."""
