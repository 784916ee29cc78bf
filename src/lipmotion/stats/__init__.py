"""Statistics shared by recogniser and engines."""
