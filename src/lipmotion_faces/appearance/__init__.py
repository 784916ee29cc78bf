"""The mouth region of a face, and the space of mouth pictures (eigenlips): vision measures them, faces draw them."""
