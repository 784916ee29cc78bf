"""Corpora from recordings: finding them in folders, tracking, division of long ones."""
