"""All readers by name."""

from fuzz.readers import faces, speech, studio

READERS = speech.READERS | faces.READERS | studio.READERS
