"""Inner loops over pixels and vertices."""
