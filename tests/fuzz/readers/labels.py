"""Files beside recordings: labels, subtitles, what recognisers write, word times, and the lists of the splits."""

import json
import math
from pathlib import Path

from formats.test_labels import TIERS, long_form
from formats.test_reported_cases import LINES, OTHERS, SERVICES, SPEAKERS
from formats.test_transcripts import OF_LINES, OF_WORDS
from formats.timing_samples import SAMPLES
from fuzz.inputs import Files, Good
from fuzz.plausible import require
from lipmotion.formats.label_files import read_labels
from lipmotion.types import TimedWord, TranscriptLine
from lipmotion_faces.corpus.folder import read_aligned_words
from lipmotion_faces.corpus.source_recordings import LISTS, RecordingFolder, SourceRecording, assign_splits
from lipmotion_faces.corpus.supplied import read_supplied_phones

TEXTS = {
    "long.TextGrid": long_form(TIERS),
    "short.TextGrid": '"ooTextFile"\n"TextGrid"\n0\n2\n<exists>\n1\n"IntervalTier"\n"words"\n0\n2\n1\n0\n2\n"hi you"\n',
    "htk.lab": "0 1000000 sil\n1000000 2000000 p\n2000000 3500000 aa\n",
    "states.lab": "0 1000000 x^sil-p+aa=t[2]\n1000000 2000000 x^sil-p+aa=t[3]\n2000000 3500000 p-aa+t[2] -61.2 baby\n",
    "starts.lab": "0 sil\n1000000 p\n2000000 aa\n",
    "audacity.txt": "0.0\t0.5\tp\n0.5\t1.25\taa\n\\\t100\t200\n",
    "lrs.txt": "Text:  HI {LG} YOU\nConf:  4\n\nWORD START END ASDSCORE\nHI 0.5 0.7 8.1\nYOU 0.7 1.2 7\n",
    "words.txt": "Hello, you 42 people.\n",
    "said.srt": "1\n00:00:00,500 --> 00:00:01,500\n<i>Hi</i> (laughs)\n\n2\n00:00:02,000 --> 00:00:03,000\nANNA: you\n",
    "said.vtt": "WEBVTT\n\nNOTE a\n\n00:00.500 --> 00:01.500 line:0\nHi<00:01.000><c> you</c>\n\n"
    "00:01.500 --> 00:01.510\nHi you\n",
    "whisper.json": '{"text": "Hi", "segments": [{"start": 0.5, "end": 1.5, "text": " Hi 2 you", "words": '
    '[{"word": " Hi", "start": 0.5, "end": 0.75}, {"word": "2"}, {"word": " you", "start": 1, "end": 1.5}]}]}',
    "cpp.json": '{"transcription": [{"offsets": {"from": 500, "to": 1500}, "text": " Hi"}]}',
    "vosk.json": '{"result": [{"conf": 1.0, "end": 1.5, "start": 0.5, "word": "hi"}], "text": "hi"}\n{"text": ""}\n',
    "words.ctm": ";; a\na 1 0.50 0.25 hi 0.9\na 1 0.75 0.5 <eps>\na 1 1.25 0.5 you\n",
    "table.tsv": "start\tend\ttext\n500\t1500\tHi you\n",
    "grid.align": "0 23750 sil\n23750 29500 bin\n29500 34000 blue\n",
}
OTHER_FORMS = {**LINES, **OTHERS, **SERVICES, **OF_LINES, **OF_WORDS}
SAMPLED = {f"{name}.json": sample for name, sample in SAMPLES.items()} | SPEAKERS
SAMPLED |= {f"{n}.{'srt' if isinstance(form, str) else 'json'}": form for n, form in enumerate(OTHER_FORMS.values())}
TEXTS |= {
    name: sample if isinstance(sample, str) else json.dumps(sample, ensure_ascii=False)
    for name, sample in SAMPLED.items()
    if not isinstance(sample, bytes)
}
SPLITS = {"train.txt": b"a\nb\n", "val.txt": b"c\n", "test.txt": b"d\n"}
LENGTH_S = 4.0


def seeds(_: Good) -> list[Files]:
    """Return labels of every kind, and lists."""
    return [SPLITS, *({name: text.encode()} for name, text in TEXTS.items())]


def read(folder: Path, _: Good) -> None:
    """Read each file by its name."""
    if any((folder / name).exists() for name in LISTS):
        recordings = tuple(SourceRecording(name, Path(f"{name}.mp4"), None) for name in "abcd")
        assign_splits(RecordingFolder("folder", recordings), folder)
        return
    for path in folder.iterdir():
        if path.suffix == ".align":
            require(bool(read_aligned_words(path)), "no word")
        else:
            _read_labels(path)


def _read_labels(path: Path) -> None:
    labels = read_labels(path)
    for line in labels.transcript.lines if labels.transcript else ():
        require(bool(line.words), "a line without a word")
        parts: list[TranscriptLine | TimedWord] = [line, *line.words]
        for part in parts:
            times_s = [time for time in (part.start_s, part.end_s) if time is not None]
            require(all(0 <= time_s < math.inf for time_s in times_s), "times that are none")
            require(times_s == sorted(times_s), "times that are not in order")
    phones = read_supplied_phones(SourceRecording("a", path, labels.words, phones=labels.phones), LENGTH_S)
    for span in phones or ():
        require(0 <= span.start_s <= span.end_s <= LENGTH_S, "a phone outside of the sound")
