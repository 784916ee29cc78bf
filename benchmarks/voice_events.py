"""How well laughter, breaths, whispering and shouting are detected, and whether breaths that are detected are seen.

    python benchmarks/voice_events.py laughing=FOLDER speech:2=FOLDER --corpus build/grid-s1 --align FOLDER

A group is a folder of recordings. Phones are not recognised: stretches between pauses count as speech without sure
words, so that the sound alone decides. Each group is divided by its people, the first four letters of names (of
``speech:2`` the first two): by the first halves the limits were chosen, the second halves are held out.
--corpus, --align : a prepared corpus, and its words in time (.align of GRID): how far tracked lips are apart in breaths
that are detected, and in the same place before the words of other sentences.
--model : also the correlation of generated and tracked openings of the sentences with such breaths, without and with
them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from lipmotion.corpora.store import Corpus
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.model import load_model
from lipmotion.pipeline.request import Request
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.spectrum import band_centres, log_bands
from lipmotion.speech.features.voice_events import voice_events
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import levels_db, spoken_spans
from lipmotion.types import Audio, Span, Timeline, Unit
from lipmotion.types.voice_event import BREATH

SOUNDS = (".wav", ".flac", ".mp3", ".ogg", ".opus", ".mkv", ".mpg", ".mp4")
ALIGN_HZ = 25_000
"""Unit of times in GRID's .align files."""


def main() -> None:
    """Print one JSON object a group and half, and one of the corpus."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("groups", nargs="*", metavar="NAME[:LETTERS]=FOLDER")
    parser.add_argument("--corpus", type=Path)
    parser.add_argument("--align", type=Path)
    parser.add_argument("--model", type=Path)
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    for group in options.groups:
        name, folder = group.split("=", 1)
        name, _, letters = name.partition(":")
        paths = sorted(path for path in Path(folder).rglob("*") if path.suffix.lower() in SOUNDS)
        for half in (0, 1):
            ours = [path for path in paths if half_of(path.name[: int(letters or 4)]) == half]
            print(json.dumps({"group": name, "half": ("chosen", "held out")[half], **detected(ours)}), flush=True)
    if options.corpus:
        corpus = Corpus.open(options.corpus)
        print(json.dumps({"group": options.corpus.name, **breaths_seen(corpus, options.align, options.model)}))
        print(json.dumps({"group": options.corpus.name, **dials(corpus, options.align)}))


def half_of(person: str) -> int:
    """Return 0 or 1, by a digest of the name of a person."""
    return int(hashlib.md5(person.encode(), usedforsecurity=False).hexdigest(), 16) % 2


def detected(paths: list[Path]) -> dict[str, object]:
    """Return the number and the seconds of recordings, and in how many of them each kind of event is detected."""
    seconds, phrases, kinds, events = 0.0, 0, Counter[str](), Counter[str]()
    for path in paths:
        audio = read_audio(path)
        units = sounding(audio)
        found = voice_events(audio, units)
        seconds, phrases = seconds + audio.duration_s, phrases + sum(span.label.phone == "aa" for span in units) // 2
        kinds.update({event.kind for event in found})
        events.update(event.kind for event in found)
    return {
        "recordings": len(paths),
        "s": round(seconds),
        "phrases": phrases,
        "with": dict(kinds),
        "events": dict(events),
    }


def sounding(audio: Audio) -> Timeline[Unit]:
    """Return two vowels, of which nobody is sure, in each stretch between pauses, and silence elsewhere."""
    spans, at_s = [], 0.0
    for start_s, end_s in spoken_spans(levels_db(audio)):
        middle_s = (start_s + end_s) / 2
        spans.append(Span(at_s, start_s, Unit("sil", confidence=0.0)))
        spans += [
            Span(start_s, middle_s, Unit("aa", confidence=0.0)),
            Span(middle_s, end_s, Unit("aa", confidence=0.0)),
        ]
        at_s = end_s
    return Timeline((*spans, Span(at_s, max(audio.duration_s, at_s), Unit("sil", confidence=0.0))))


def breaths_seen(corpus: Corpus, align: Path, model: Path | None) -> dict[str, object]:
    """Return how many breaths are detected before the words of sentences, and how far the lips are apart then."""
    breaths, plain, named = [], [], []
    for split in ("train", "val"):
        for name in corpus.names(split):
            utterance = corpus.utterance(name)
            units = words_in_time(align / f"{name}.align")
            begins_s = next(span.start_s for span in units if span.label.phone != "sil")
            track = utterance.track.motion
            before = [event for event in voice_events(utterance.audio, units) if event.end_s <= begins_s]
            curve = (track.time_s - begins_s, track["opening"].astype(float))
            breaths += [(event.start_s - begins_s, event.end_s - begins_s, curve) for event in before[-1:]]
            plain += [] if before else [curve]
            named += [name] if before else []
    rows = []
    for first_s, last_s, curve in breaths:
        others = [opening_in(other, first_s, last_s) for other in plain if other[0][0] <= first_s]
        rows.append((opening_in(curve, first_s, last_s), float(np.nanmean(others)) if others else np.nan))
    seen = np.array(rows)
    return {
        "sentences": len(plain) + len(breaths),
        BREATH: len(breaths),
        "opening": round(float(np.nanmean(seen[:, 0])), 3),
        "elsewhere": round(float(np.nanmean(seen[:, 1])), 3),
        "more open": int((seen[:, 0] > seen[:, 1]).sum()),
        "ACC": {manner: acc(corpus, named, model, manner) for manner in ("asked", "detected") if model},
    }


def acc(corpus: Corpus, names: list[str], model: Path, manner: str) -> float:
    """Return the mean correlation of generated and tracked openings of some sentences, by sound alone."""
    loaded, found = load_model(model), []
    for name in names:
        utterance = corpus.utterance(name)
        track = utterance.track.motion
        made = animate(Request(utterance.audio, manner=manner), model=loaded).motion
        generated = np.interp(track.time_s, made.time_s, made["opening"])
        found.append(np.corrcoef(generated, track["opening"])[0, 1])
    return round(float(np.mean(found)), 4)


def dials(corpus: Corpus, align: Path) -> dict[str, object]:
    """Return how loudness, brightness and pitch of a word correlate with its opening and width, against its like."""
    words = defaultdict[str, list[list[float]]](list)
    for name in corpus.names("train"):
        utterance = corpus.utterance(name)
        track, centres = utterance.track.motion, band_centres()
        powers, pitch = np.exp(log_bands(utterance.audio.samples).astype(float)), log_f0(utterance.audio)
        for span in words_in_time(align / f"{name}.align"):
            inside = (track.time_s >= span.start_s - 0.04) & (track.time_s < span.end_s + 0.04)
            frames = slice(round(span.start_s * 100), min(round(span.end_s * 100), len(pitch)))
            voiced = np.isfinite(pitch[frames])
            if span.label.phone == "sil" or voiced.sum() < 4 or inside.sum() < 3:
                continue
            spoken = powers[frames][voiced]
            high, low = spoken[:, (centres >= 1000) & (centres < 4500)].sum(), spoken[:, centres < 1000].sum()
            seen = track["opening"][inside].max(), np.ptp(track["width"][inside])
            voice = np.log(spoken.sum(axis=1).mean()), np.log(high / low), np.median(pitch[frames][voiced])
            words[span.label.word].append([float(value) for value in (*seen, *voice)])
    rows = np.vstack([np.array(same) - np.mean(same, axis=0) for same in words.values() if len(same) >= 8])
    found = np.corrcoef(rows.T)[:2, 2:].round(2).tolist()
    names = ("loudness", "brightness", "pitch")
    curves = zip(("opening", "range of the width"), found, strict=True)
    return {"words": len(rows)} | {curve: dict(zip(names, row, strict=True)) for curve, row in curves}


def opening_in(curve: tuple[np.ndarray, np.ndarray], first_s: float, last_s: float) -> float:
    """Return the mean opening of a track between two times; NaN where it has none."""
    inside = (curve[0] >= first_s) & (curve[0] < last_s)
    return float(curve[1][inside].mean()) if inside.any() else float("nan")


def words_in_time(path: Path) -> Timeline[Unit]:
    """Return a vowel for each word of an .align file, and its silences."""
    rows = (line.split() for line in path.read_text(encoding="ascii").splitlines())
    times = ((int(first) / ALIGN_HZ, int(last) / ALIGN_HZ, word) for first, last, word in rows)
    phones = ((a, b, "sil" if word in ("sil", "sp") else "aa", word) for a, b, word in times)
    return Timeline(tuple(Span(a, b, Unit(phone, word=word)) for a, b, phone, word in phones))


if __name__ == "__main__":
    main()
