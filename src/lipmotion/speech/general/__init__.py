"""The phone models of many voices that come with pocketsphinx, behind our own decoder."""
