"""The engines of this project compared in one table."""
