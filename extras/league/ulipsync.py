"""uLipSync in Python (package ``pylipsync``): vowels and silence. Settings: ``method``, ``silence``, ``window_ms``."""

import wave

from jobs import run


def begin(settings):
    """Return a function of a recording."""
    import numpy as np
    from pylipsync import CompareMethod, PhonemeAnalyzer

    analyser = PhonemeAnalyzer(compare_method=CompareMethod[settings["method"]], silence_threshold=settings["silence"])

    def answer(recording):
        with wave.open(recording["sound"]) as sound:
            samples = np.frombuffer(sound.readframes(sound.getnframes()), "<i2").astype(np.float32) / 32768
            rate_hz = sound.getframerate()
        segments = analyser.extract_phoneme_segments(
            samples, rate_hz, window_size_ms=settings["window_ms"], fps=50, return_seconds=True
        )
        names = [phone.name for phone in segments[0].phonemes]
        weights = {name: [segment.phonemes[n].target for segment in segments] for n, name in enumerate(names)}
        return [(segment.start + segment.end) / 2 for segment in segments], weights

    return answer


run(begin)
