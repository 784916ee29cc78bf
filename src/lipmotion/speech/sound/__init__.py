"""Sound: files, decoding, resampling, noise, offsets, pauses."""
