"""Files of voices and aligners as the services document them, written for these tests."""

import json
from typing import Any


def json_lines(*values: Any) -> str:
    return "".join(json.dumps(value, ensure_ascii=False) + "\n" for value in values)


def polly(kind: str, time: int, value: str, **more: int) -> dict[str, Any]:
    return {"time": time, "type": kind, **more, "value": value}


POLLY = json_lines(
    polly("sentence", 0, "Mama bites.", start=0, end=11),
    polly("word", 60, "Mama", start=0, end=4),
    *(polly("viseme", time, name) for time, name in ((0, "sil"), (60, "p"), (120, "a"), (210, "p"), (300, "@"))),
    polly("ssml", 400, "here", start=4, end=5),
    polly("word", 700, "bites", start=5, end=10),
    *(polly("viseme", time, name) for time, name in ((400, "sil"), (700, "p"), (780, "a"), (950, "t"), (990, "s"))),
    polly("viseme", 1100, "sil"),
)
AZURE_WORDS = [
    {"AudioOffset": 500_000, "Duration": "3375000", "Text": "Hello", "WordLength": 5, "BoundaryType": "WordBoundary"},
    {"AudioOffset": 3_875_000, "Duration": 625_000, "Text": ",", "BoundaryType": "PunctuationBoundary"},
    {"AudioOffset": 4_500_000, "Duration": 3_000_000, "Text": "you", "BoundaryType": "WordBoundary"},
]
AZURE_VISEMES = [
    {"privAudioOffset": offset, "privVisemeId": number, "privAnimation": ""}
    for offset, number in ((500_000, 0), (1_000_000, 12), (1_625_000, 4), (2_000_000, 14), (3_000_000, 8))
]
ELEVENLABS = {"audio_base64": "AAAA", "alignment": {
    "characters": list("[sighs] Hi 2."),
    "character_start_times_seconds": [0.0] * 8 + [0.5, 0.6, 0.7, 0.8, 1.1],
    "character_end_times_seconds": [0.0] * 8 + [0.6, 0.7, 0.8, 1.1, 1.2]}}  # fmt: skip
CARTESIA = json_lines(
    {"type": "chunk", "data": "AAAA", "done": False},
    {"type": "timestamps", "word_timestamps": {"words": ["Hi", "you"], "start": [0, 0.5], "end": [0.4, 0.9]}},
    {"type": "phoneme_timestamps", "phoneme_timestamps": {
        "phonemes": ["h", "aɪ", "j", "u"], "start": [0.0, 0.1, 0.5, 0.6], "end": [0.1, 0.4, 0.6, 0.9]}},
    {"type": "done", "done": True},
)  # fmt: skip
GOOGLE = {"timepoints": [{"markName": w, "timeSeconds": t} for w, t in (("hello", 0.25), ("you", 0.75))]}
PIPER = {"sample_rate": 20000, "phoneme_alignments": [
    {"phoneme": phoneme, "phoneme_ids": [1, 0], "num_samples": 1000 * count}
    for phoneme, count in zip("^hˈaɪ ju.$", (1, 2, 1, 2, 2, 1, 1, 2, 4, 1), strict=True)]}  # fmt: skip
KOKORO = {"graphemes": "Hi you.", "phonemes": "hˈI ju.", "pred_dur": [10, 4, 2, 6, 2, 4, 8, 10, 10], "tokens": [
    {"text": "Hi", "phonemes": "hˈI", "start_ts": 0.25, "end_ts": 0.55},
    {"text": "you", "phonemes": "ju", "start_ts": 0.6, "end_ts": 0.9},
    {"text": ".", "phonemes": ".", "start_ts": None, "end_ts": None}]}  # fmt: skip
GENTLE = {"transcript": "hi there you", "words": [
    {"case": "success", "alignedWord": "hi", "word": "Hi", "start": 0.1, "end": 0.4, "startOffset": 0,
     "phones": [{"duration": 0.1, "phone": "hh_B"}, {"duration": 0.2, "phone": "ay_E"}]},
    {"case": "not-found-in-audio", "word": "there", "startOffset": 3, "endOffset": 8},
    {"case": "success", "alignedWord": "<unk>", "word": "you", "start": 0.5, "end": 0.8,
     "phones": [{"duration": 0.3, "phone": "oov_S"}]}]}  # fmt: skip
MFA = {"start": 0, "end": 1.0, "tiers": {
    "words": {"type": "interval", "entries": [[0.0, 0.1, ""], [0.1, 0.5, "my"], [0.5, 1.0, "spot"]]},
    "phones": {"type": "interval", "entries": [
        [0.1, 0.2, "m"], [0.2, 0.5, "aj"], [0.5, 0.6, "s"], [0.6, 0.7, "p"], [0.7, 0.9, "ɒː"], [0.9, 1.0, "tʰ"]]},
}}  # fmt: skip
MFA_CSV = "Begin,End,Label,Type,Speaker\n0.1,0.5,my,words,ann\n0.1,0.2,M,phones,ann\n0.2,0.5,AY1,phones,ann\n"
SAMPLES = {
    "polly": POLLY, "words": AZURE_WORDS, "visemes": AZURE_VISEMES, "characters": ELEVENLABS, "messages": CARTESIA,
    "marks": GOOGLE, "piper": PIPER, "kokoro": KOKORO, "gentle": GENTLE, "mfa": MFA, "table": MFA_CSV,
    "servers": {"timestamps": [{"word": "Hi,", "start_time": 0.1, "end_time": 0.4}]},
}  # fmt: skip
"""A text, or a value for JSON, of every kind."""
