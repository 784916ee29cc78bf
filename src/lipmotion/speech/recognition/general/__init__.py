"""The general models: speaker-independent English phone models that come with pocketsphinx, for our own decoder."""
