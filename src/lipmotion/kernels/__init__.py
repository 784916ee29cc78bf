"""Arrays in, arrays out: the inner loops. Shapes are the callers' duty."""
