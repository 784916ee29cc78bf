"""Events of a voice beside its words: what is detected of laughter, breath and effort."""

from __future__ import annotations

from dataclasses import dataclass, replace

LAUGHTER, BREATH, WHISPER, SHOUT = "laughter", "breath", "whisper", "shout"


@dataclass(frozen=True)
class VoiceEvent:
    """Something detected in a voice beside its words (``speech.features.voice_events``).

    start_s, end_s : seconds
    kind     : ``LAUGHTER`` (a bout), ``BREATH`` (drawn in, in a pause), ``WHISPER`` or ``SHOUT`` (a phrase)
    strength : 0 to 1: how sure laughter and whispering are; of a breath, how far it stands out of the noise of the
               recording; of a shout, how far it is from the recording's other phrases
    calls    : of laughter, the time in seconds of each "ha", and its loudness beside the loudest one, 0 to 1: half of
               it 10 dB lower
    """

    start_s: float
    end_s: float
    kind: str
    strength: float
    calls: tuple[tuple[float, float], ...] = ()

    def shifted(self, offset_s: float) -> VoiceEvent:
        """Return the event with ``offset_s`` seconds added to all times."""
        calls = tuple((time_s + offset_s, loudness) for time_s, loudness in self.calls)
        return replace(self, start_s=self.start_s + offset_s, end_s=self.end_s + offset_s, calls=calls)
