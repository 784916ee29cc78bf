"""Inner loops over sequences: state networks, chains, parameter generation."""
