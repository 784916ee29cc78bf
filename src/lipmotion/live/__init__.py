"""Speech as it comes: a microphone, the sound of a voice agent, a stream."""
