"""Motion → what people look at."""
