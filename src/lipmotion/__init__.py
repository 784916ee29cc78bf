"""Speech in, lip motion out."""
