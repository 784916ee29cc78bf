"""Motion to what files, videos and scenes hold."""
