"""Files: written whole or not at all, arrays with a JSON header, what is read from media, what is checked when read."""
