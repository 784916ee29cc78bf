"""Source recordings in folders, and the corpus that is prepared from them."""
