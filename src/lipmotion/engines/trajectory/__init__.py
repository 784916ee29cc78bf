"""Context-dependent units, backed-off statistics of motion, parameter generation (Hofer 2008)."""
