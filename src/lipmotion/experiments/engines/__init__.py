"""The engines of this project compared in one table, a hybrid of two of them, and how far they disagree."""
