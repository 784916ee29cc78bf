"""Words and phones in time that voices (text to speech) and aligners write, one module for each service."""
