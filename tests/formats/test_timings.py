import json
from pathlib import Path
from typing import Any

import pytest

from formats.timing_samples import (
    AZURE_VISEMES,
    AZURE_WORDS,
    CARTESIA,
    ELEVENLABS,
    GENTLE,
    GOOGLE,
    KOKORO,
    MFA,
    MFA_CSV,
    PIPER,
    POLLY,
    SERVERS,
    lines,
)
from lipmotion.errors import InputError
from lipmotion.formats.label_files import find_labels, holds_timings, read_labels, read_phones, read_transcript
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.types import TimedTranscript


@pytest.fixture
def file(tmp_path: Path) -> Any:
    """Return a file with some content, or the JSON of a value."""

    def write(content: Any, name: str = "a.json") -> Path:
        path = tmp_path / name
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return path

    return write


def words(path: Path) -> list[tuple[str, float | None, float | None]]:
    found = read_transcript(path)
    assert isinstance(found, TimedTranscript)
    rows = [(word.word, word.start_s, word.end_s) for line in found.lines for word in line.words]
    return [(word, start and round(start, 6), end and round(end, 6)) for word, start, end in rows]


def phones(path: Path) -> list[tuple[float, float, str, str]]:
    units = read_units(path)
    return [(round(s.start_s, 6), round(s.end_s, 6), s.label.phone or s.label.unit, s.label.word) for s in units]


WORDS = {
    "Polly": (POLLY, [("mama", 0.06, 0.4), ("bites", 0.7, 1.1)]),
    "Azure's boundaries": (AZURE_WORDS, [("hello", 0.05, 0.3875), ("you", 0.45, 0.75)]),
    "Azure's batch": ([{"Text": "the", "AudioOffset": 38, "Duration": 153}], [("the", 0.038, 0.191)]),
    "ElevenLabs": (ELEVENLABS, [("hi", 0.5, 0.7), ("2", 0.8, 1.2)]),
    "ElevenLabs' pieces": (
        lines(
            {"alignment": {"characters": ["h"], "character_start_times_seconds": [0.5],
                           "character_end_times_seconds": [0.6]}},
            {"alignment": None},
            {"alignment": {"characters": ["i"], "character_start_times_seconds": [0.6],
                           "character_end_times_seconds": [0.75]}},
        ),
        [("hi", 0.5, 0.75)],
    ),
    "ElevenLabs' socket": (
        {"audio": "", "isFinal": False, "normalizedAlignment":
            {"chars": [" ", "h", "i"], "charStartTimesMs": [0, 100, 200], "charsDurationsMs": [100, 100, 150]}},
        [("hi", 0.1, 0.35)],
    ),
    "Cartesia": (CARTESIA, [("hi", 0, 0.4), ("you", 0.5, 0.9)]),
    "Google": (GOOGLE, [("hello", 0.25, 0.75), ("you", 0.75, None)]),
    "Kokoro": (KOKORO, [("hi", 0.25, 0.55), ("you", 0.6, 0.9)]),
    "servers of Kokoro": (SERVERS, [("hi", 0.1, 0.4)]),
    "Gentle": (GENTLE, [("hi", 0.1, 0.4), ("you", 0.5, 0.8)]),
    "MFA": (MFA, [("my", 0.1, 0.5), ("spot", 0.5, 1.0)]),
    "MFA's table": (MFA_CSV, [("my", 0.1, 0.5)]),
}  # fmt: skip
PHONES = {
    "Polly": (POLLY, "sil p/mama aa/mama p/mama ax/mama sil p/bites aa/bites t/bites s/bites sil", 0.4),
    "Azure": (AZURE_VISEMES, "sil hh eh l ow", 0.2),
    "Cartesia": (CARTESIA, "hh/hi ay/hi sp y/you uw/you", 0.4),
    "Piper": (PIPER, "sil hh ay sp y uw sil sil", 0.4),
    "Kokoro": (KOKORO, "sil hh/hi ay/hi sp y/you uw/you sil sil", 0.55),
    "Gentle": (GENTLE, "hh/hi ay/hi sp spn/you", 0.4),
    "MFA": (MFA, "m/my ay/my s/spot p/spot ao/spot t/spot", 0.5),
    "MFA's table": (MFA_CSV, "m/my ay/my", 0.5),
}
"""Phones with their words, in order, and the end of one of them."""


@pytest.mark.parametrize("name", WORDS)
def test_words_in_time(file: Any, name: str) -> None:
    content, expected = WORDS[name]
    assert words(file(content)) == expected
    assert holds_timings(file(content))


@pytest.mark.parametrize("name", PHONES)
def test_phones_in_time(file: Any, name: str) -> None:
    content, expected, end_s = PHONES[name]
    found = phones(file(content))
    assert [f"{phone}/{word.lower()}" if word else phone for *_, phone, word in found] == expected.split()
    assert end_s in [each[1] for each in found]
    starts, ends = [each[0] for each in found[1:]], [each[1] for each in found[:-1]]
    assert ends == pytest.approx(starts, abs=0.11) or name == "Cartesia"


def test_a_textgrid_in_ipa(file: Any) -> None:
    rows = "".join(f'{start}\n{end}\n"{text}"\n' for start, end, text in ((0, 0.1, "m"), (0.1, 0.4, "ɒ"), (0.4, 1, "")))
    grid = f'"ooTextFile"\n"TextGrid"\n0\n1\n<exists>\n1\n"IntervalTier"\n"phones"\n0\n1\n3\n{rows}'
    assert phones(file(grid, "a.TextGrid")) == [(0, 0.1, "m", ""), (0.1, 0.4, "ao", ""), (0.4, 1, "sil", "")]


def test_beside_a_recording_and_other_suffixes(file: Any, tmp_path: Path) -> None:
    file(POLLY, "take.json")
    assert find_labels(tmp_path / "take.wav").words == ("mama", "bites")
    assert phones(file(POLLY, "take.marks")) == phones(file(POLLY, "take.jsonl")) == phones(tmp_path / "take.json")
    assert phones(file(MFA_CSV, "take.csv")) == phones(file(MFA_CSV, "b.txt"))
    assert read_labels(file(CARTESIA)).phones is not None
    assert read_phones(file(MFA_CSV, "b.txt"))[0].label.word == "my"


ERRORS = {
    "a viseme of Polly": (
        POLLY.replace('"@"', '"Q"'), r"a\.json: line 7: no viseme of Polly is 'Q'; known are: sil p t"),
    "a viseme of Azure": ([{"audio_offset": 0, "viseme_id": 22}], "the viseme is 22, required a whole"),
    "a symbol": (CARTESIA.replace('"aɪ"', '"§"'), "phonemes 2 is '§', which is no phone"),
    "lists": (CARTESIA.replace("[0, 0.5]", "[0]"), "line 2, .*: required are the lists words, start"),
    "a mark": ({"timepoints": [{"markName": "m1"}]}, "timepoints 1 is the mark 'm1', which is no word; name every"),
    "a rate": ({**PIPER, "sample_rate": 0}, "line 1: the sample rate in hertz is 0, required"),
    "durations": ({**KOKORO, "pred_dur": [1]}, "1 durations of 7 phonemes, required two more than phonemes"),
    "an event without a time": ([{"Text": "a", "AudioOffset": None}], "no words in time are found"),
    "a time": ({**MFA, "tiers": {"words": {"entries": [["x", 1, "a"]]}}}, "entry 1: a time is 'x', required a number"),
    "a line": (MFA_CSV + "0.5,x\n", "line 5 is '0.5,x'; required, as in line 1: Begin,End"),
    "pieces of the socket": (
        lines(*[{"alignment": {"chars": ["a"], "charStartTimesMs": [0], "charDurationsMs": [1]}}] * 2),
        "holds 2 pieces whose times each begin at 0",
    ),
    "a symbol without end": (CARTESIA.replace('"aɪ"', f'"{"a" * 41}"'), "has 41 letters, required a phone: 40 at most"),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_what_is_not_understood_is_named(file: Any, name: str) -> None:
    content, message = ERRORS[name]
    with pytest.raises(InputError, match=message):
        read_labels(file(content))


def test_words_alone_are_no_units_and_visemes_alone_no_transcript(file: Any) -> None:
    with pytest.raises(InputError, match=r"holds words in time, but no phones; give it as a transcript"):
        read_units(file(ELEVENLABS))
    with pytest.raises(InputError, match="phones in time, but no words; give them as units"):
        read_transcript(file(AZURE_VISEMES))


def test_words_that_gentle_did_not_find_are_reported(file: Any, caplog: pytest.LogCaptureFixture) -> None:
    read_labels(file(GENTLE))
    assert "1 words were not found in the sound and are left out" in caplog.text
