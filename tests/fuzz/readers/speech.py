"""Readers of recordings and what lies beside them, of corpora, models, phones, lexicons and transcripts."""

import json
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from formats.examples import LABEL_CASES
from formats.test_labels import TIERS, long_form
from fuzz import inputs
from lipmotion import Corpus, Request, animate, load_model, read_motion, write
from lipmotion.formats.label_files import read_labels
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Motion, Span, TimedWord, Timeline, Track, TranscriptLine, Unit, Utterance
from lipmotion.units import PHONES, Lexicon
from lipmotion_faces.corpus.folder import read_aligned_words
from lipmotion_faces.corpus.source_recordings import LISTS, RecordingFolder, SourceRecording, assign_splits
from lipmotion_faces.corpus.supplied import read_supplied_phones
from pipeline.made import features_of
from robustness.motion_cases import GOOD
from speech.sounds import tone, write_sound

SECONDS = 0.6
CODECS = {
    **{"wav": "pcm_s16le", "float.wav": "pcm_f32le", "law.wav": "pcm_alaw", "flac": "flac", "mp3": "libmp3lame"},
    **{"ogg": "libopus", "mp4": "aac", "mkv": "aac", "aiff": "pcm_s16be", "caf": "pcm_s16be", "avi": "pcm_s16le"},
    **{"ts": "aac", "webm": "libopus", "au": "pcm_s16be", "mka": "flac"},
}
AUDIO_TEXTS = {
    "list.m3u8": "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\na.wav\n#EXT-X-ENDLIST\n",
    "list.txt": "ffconcat version 1.0\nfile a.wav\nduration 1\n",
    "a.idx": "# VobSub index file, v7 (do not modify this line!)\nsize: 720x576\nid: en, index: 0\n"
    "timestamp: 00:00:01:000, filepos: 000000000\n",
    "a.srt": "1\n00:00:01,000 --> 00:00:02,000\nhello\n",
}


def seed_audio(_: inputs.Good) -> list[inputs.Files]:
    """Return a tone in many containers, with video, with a gap; and texts that FFmpeg accepts as recordings."""
    with tempfile.TemporaryDirectory() as made:
        folder, paths = Path(made), list[Path]()
        for name, codec in CODECS.items():
            rate_hz = 48_000 if codec == "libopus" else 16_000
            paths.append(write_sound(folder / f"a.{name}", tone(rate_hz, SECONDS), rate_hz, codec))
        for name in ("video.mp4", "video.mkv"):
            sound = tone(16_000, SECONDS, 2)
            paths.append(write_sound(folder / name, sound, 16_000, "aac", video=True, start_s=0.1))
        paths.append(write_sound(folder / "hole.mka", tone(16_000, 2.0), 16_000, "flac", hole_s=(0.5, 1.0)))
        found = [{path.name: path.read_bytes()} for path in paths]
    return found + [{name: text.encode()} for name, text in AUDIO_TEXTS.items()]


def check_audio(folder: Path, _: inputs.Good) -> None:
    """Read a recording; compute its features."""
    (path,) = folder.iterdir()
    audio = read_audio(path)
    inputs.require(bool(np.isfinite(audio.samples).all()), "samples that are not finite")
    inputs.require(audio.duration_s <= inputs.LONGEST_S, "hours of sound")
    inputs.require(bool(np.isfinite(analysed(audio).mfcc().values).all()), "features that are not finite")


CORPUS_SAMPLES, FRAMES = 8000, 13
PIXELS = (4, 6, 3)
AGES_S = 1e11
CORPUS_PHONES = Timeline((Span(0.0, 0.3, Unit("sil")), Span(0.3, 0.5, Unit("b"))))


def seed_corpus(good: inputs.Good) -> list[inputs.Files]:
    """Return corpora of half a second: with labelled phones and tiny mouth pictures, without, without checksums."""
    corpus = Corpus.open(good.corpus)
    first = corpus.utterance(corpus.names()[0])
    audio = Audio(first.audio.samples[:CORPUS_SAMPLES].copy(), first.audio.rate_hz)
    motion = first.track.motion
    track = Track(Motion(motion.values[:FRAMES], motion.rate_hz, motion.channels), np.ones(FRAMES, bool))
    small = replace(first, audio=audio, features=features_of(audio), track=track)
    track = replace(track, crops=np.zeros((FRAMES, *PIXELS), np.uint8))
    labelled = replace(small, speaker="anna", phones=CORPUS_PHONES, track=track)
    return [_corpus(labelled), _corpus(small), _without_checksums(_corpus(small))]


def _without_checksums(files: inputs.Files) -> inputs.Files:
    """Return a corpus without checksums, as earlier versions wrote it, so that damaged arrays are read."""
    (name,) = (name for name in files if name.endswith("entry.json"))
    entry = json.loads(files[name])
    entry.pop("checksums", None)
    return files | {name: json.dumps(entry).encode()}


def _corpus(utterance: Utterance) -> inputs.Files:
    with tempfile.TemporaryDirectory() as folder:
        corpus = Corpus.create(Path(folder) / "corpus")
        corpus.add(utterance)
        return inputs.picked_up(Path(folder))


def check_corpus(folder: Path, _: inputs.Good) -> None:
    """Open a corpus; check every array of every utterance."""
    corpus = Corpus.open(folder / "corpus")
    corpus.summary()
    inputs.require(all(0 <= seconds < AGES_S for _, seconds in corpus.speakers.values()), "ages of speech")
    for name in corpus.names():
        utterance = corpus.utterance(name)
        inputs.check_motion(utterance.track.motion)
        inputs.require(bool(np.isfinite(utterance.features.values).all()), "features that are not finite")
        if utterance.track.crops is not None:
            utterance.track.crops.mean()


LABELS_TEXTS = {
    "long.TextGrid": long_form(TIERS),
    "words.txt": "Hello, you 42 people.\n",
    "grid.align": "0 23750 sil\n23750 29500 bin\n29500 34000 blue\n",
}
for _number, _case in enumerate(LABEL_CASES.values()):
    _content = _case["content"]
    LABELS_TEXTS[f"{_number}.json"] = (
        _content if isinstance(_content, str) else json.dumps(_content, ensure_ascii=False)
    )
SPLITS = {"train.txt": b"a\nb\n", "val.txt": b"c\n", "test.txt": b"d\n"}
LENGTH_S = 4.0


def seed_labels(_: inputs.Good) -> list[inputs.Files]:
    """Return labels of every kind, and lists."""
    return [SPLITS, *({name: text.encode()} for name, text in LABELS_TEXTS.items())]


def check_labels(folder: Path, _: inputs.Good) -> None:
    """Read each file by its name."""
    if any((folder / name).exists() for name in LISTS):
        recordings = tuple(SourceRecording(name, Path(f"{name}.mp4"), None) for name in "abcd")
        assign_splits(RecordingFolder("folder", recordings), folder)
        return
    for path in folder.iterdir():
        if path.suffix == ".align":
            inputs.require(bool(read_aligned_words(path)), "no word")
        else:
            _read_labels(path)


def _read_labels(path: Path) -> None:
    labels = read_labels(path)
    for line in labels.transcript.lines if labels.transcript else ():
        inputs.require(bool(line.words), "a line without a word")
        parts: list[TranscriptLine | TimedWord] = [line, *line.words]
        for part in parts:
            times_s = [time for time in (part.start_s, part.end_s) if time is not None]
            inputs.require(all(0 <= time_s < math.inf for time_s in times_s), "times that are none")
            inputs.require(times_s == sorted(times_s), "times that are not in order")
    phones = read_supplied_phones(SourceRecording("a", path, labels.words, phones=labels.phones), LENGTH_S)
    for span in phones or ():
        inputs.require(0 <= span.start_s <= span.end_s <= LENGTH_S, "a phone outside of the sound")


def seed_model(good: inputs.Good) -> list[inputs.Files]:
    """Return a model of every engine."""
    return [{"a.lipmotion": path.read_bytes()} for path in good.models]


def check_model(folder: Path, good: inputs.Good) -> None:
    """Load a model; animate short speech, without and with a transcript."""
    model = load_model(folder / "a.lipmotion")
    for text in (None, "baby"):
        inputs.check_generation(
            animate(Request(inputs.short_speech(good), transcript=text, recogniser="own"), model=model)
        )


def seed_units(good: inputs.Good) -> list[inputs.Files]:
    """Return motion files of ``animate``, and a minimal one."""
    found: list[inputs.Files] = [{"a.json": json.dumps(GOOD).encode()}]
    result = animate(Request(inputs.short_speech(good), recogniser="own"), model=inputs.good_model(good))
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "a.json", Path(folder) / "a.npz"]
        write(result, paths, channels=["opening"])
        return found + [{path.name: path.read_bytes()} for path in paths]


def check_units(folder: Path, good: inputs.Good) -> None:
    """Animate a short sound with these phones."""
    (path,) = folder.iterdir()
    units = read_motion(path)[1]
    inputs.check_generation(
        animate(Request(inputs.short_speech(good), units=units, recogniser="own"), model=inputs.good_model(good))
    )


LEXICONS = (
    "# mine\nlipmotion L IH1 P M OW1 SH AH0 N\nnäh N EH\nlive(2) l ay v\n",
    "baby B EY1 B IY0\nbaby(2) b ey b ix\n'bout b aw t # short\n\n",
    "two T UW1\n2 t uw\n",
)


def seed_lexicon(_: inputs.Good) -> list[inputs.Files]:
    """Return small lexicons."""
    return [{"words.dict": text.encode()} for text in LEXICONS]


def check_lexicon(folder: Path, good: inputs.Good) -> None:
    """Read a lexicon; align short speech with its first word."""
    lexicon = Lexicon.from_file(folder / "words.dict")
    for word, pronunciations in lexicon.user.items():
        inputs.require(lexicon.known(word), "a word that is not known")
        inputs.require(all(set(phones) <= set(PHONES) for phones in pronunciations), "a phone that is none")
    words = " ".join(list(lexicon.user)[:1])
    request = Request(inputs.short_speech(good), words or "baby", lexicon=lexicon, recogniser="own")
    inputs.check_generation(animate(request, model=inputs.good_model(good)))


TRANSCRIPTS = (
    "baby",
    "Hi, 2!\n",
    "Mama's \u201cmap\u201d, ﬁve\n",
    "o'clock: 1,000\n",
    "Hello, you 42 people.\n",
    "baby's mother-in-law has 1,234,567 cats; 3 o'clock! (See two maps.)\nNow £5, 007, ½, twenty-three.\n",
    "naïve qwrx zzyx",
    "1\n00:00:00,100 --> 00:00:00,600\n<i>Baby</i>\n",
    '{"result": [{"word": "baby", "start": 0.1, "end": 0.5}], "text": "baby"}',
)
"""Some are too long for the sound, or have words without a pronunciation; the last ones have times."""


def seed_transcript(_: inputs.Good) -> list[inputs.Files]:
    """Return texts with punctuation, numbers, and unknown words."""
    return [{"said.txt": text.encode()} for text in TRANSCRIPTS]


def check_transcript(folder: Path, good: inputs.Good) -> None:
    """Animate short speech with the transcript."""
    path = folder / "said.txt"
    inputs.check_generation(
        animate(Request(inputs.short_speech(good), transcript=path, recogniser="own"), model=inputs.good_model(good))
    )


READERS = {
    "audio": inputs.Reader("audio", seed_audio, check_audio),
    "labels": inputs.Reader("labels", seed_labels, check_labels),
    "corpus": inputs.Reader("corpus", seed_corpus, check_corpus),
    "model": inputs.Reader("model", seed_model, check_model),
    "units": inputs.Reader("units", seed_units, check_units),
    "lexicon": inputs.Reader("lexicon", seed_lexicon, check_lexicon),
    "transcript": inputs.Reader("transcript", seed_transcript, check_transcript),
}
