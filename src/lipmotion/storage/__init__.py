"""Reading and writing of files: atomic writes, archives of arrays, checks of stored arrays, JSON, and media."""
