"""Corpora from videos: tracking, division of long recordings."""
