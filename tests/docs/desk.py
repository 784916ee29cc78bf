"""A folder with all that commands on pages name: speech, words, motion, corpora, models, characters, answers."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import lipmotion
from docs.site_pages import ROOT
from lipmotion import Corpus
from lipmotion.types import Audio
from lipmotion_studio.study.answers import write_answers
from meshes.heads import head, lip_points, write_glb, write_obj
from pipeline.made import write_sound
from studio.toy_recordings import write_takes
from study.simulated import Effects, rated_answers, ratings
from testing.toy import ToySentence, toy_sentences, toy_utterances

SAID = ("speech", "talk", "a", "b", "one", "lines/one", "perro")
CORPORA = ("CORPUS", "my-corpus", "build/grid-s1")


def set_desk(folder: Path, models: dict[str, Path]) -> None:
    """Fill a folder; ``models``: files by the names that pages give them."""
    shutil.copytree(ROOT / "examples", folder / "examples")
    for name in ("welcome.flac", "three.flac"):
        shutil.copy(ROOT / "examples" / "welcome.flac", folder / name)
    for name, file in models.items():
        shutil.copy(file, folder / name)
    for name in CORPORA:
        corpus = Corpus.create(folder / name)
        for utterance in toy_utterances(3):
            corpus.add(utterance)
    words = _speech(folder, toy_sentences(3)[0])
    for name in ("speech", "sentences", "script", "story"):
        (folder / f"{name}.txt").write_text(words, encoding="utf-8")
    units = (ROOT / "docs" / "unit-sets.md").read_text("utf-8").partition("```text\n")[2].partition("```")[0]
    (folder / "my-units.txt").write_text(units, encoding="utf-8")
    (folder / "names.txt").write_text("anna AE N AH\n", encoding="utf-8")
    (folder / "lines.csv").write_text("file\nspeech.wav\n", encoding="utf-8")
    segments = [{"start": 0.1, "end": 1.0, "text": words}]
    (folder / "talk.json").write_text(json.dumps({"segments": segments}), encoding="utf-8")
    for name in ("RECORDINGS", "takes"):
        write_takes(folder / name, 3)
    _motion(folder, words)
    _of_other_programs(folder, words)
    _characters(folder)
    judged = ratings(np.random.default_rng(2), np.array([3.0, 4.0]), (8, 6), Effects())
    write_answers(folder / "answers.csv", rated_answers(replace(judged, conditions=("ph-HMM", "ph-CHMM"))))


def copied(desk: Path, folder: Path) -> Path:
    """Return a copy of the folder whose files are the same until they are replaced."""
    return Path(shutil.copytree(desk, folder, copy_function=os.link))


def _speech(folder: Path, sentence: ToySentence) -> str:
    """Write the first word of a sentence as several recordings; return it."""
    word = sentence.words[0]
    end_s = [span.end_s for span in sentence.units if span.label.word == word][-1] + 0.2
    sound = Audio(sentence.audio.samples[: round(end_s * sentence.audio.rate_hz)], sentence.audio.rate_hz)
    for name in SAID:
        (folder / name).parent.mkdir(exist_ok=True)
        write_sound(folder / f"{name}.wav", sound)
    return word


def _motion(folder: Path, words: str) -> None:
    """Write motion of the speech, also as others name it, and a video."""
    said = lipmotion.animate(folder / "speech.wav", transcript=words)
    names = ("speech.json", "mine.json", "reference.json", "theirs.csv", "film.mp4", "two.mp4")
    lipmotion.write(said, [folder / name for name in names], speech=folder / "speech.wav", fps=10.0)
    (folder / "film.srt").write_text(f"1\n00:00:00,100 --> 00:00:01,000\n{words}\n", encoding="utf-8")


def _of_other_programs(folder: Path, words: str) -> None:
    """Write the timings of a voice, cues, and drawings of mouth shapes."""
    shutil.copy(folder / "speech.wav", folder / "line.mp3")
    visemes = ((0, "sil"), (100, "p"), (200, "a"))
    marks = [{"time": time_ms, "type": "viseme", "value": name} for time_ms, name in visemes]
    (folder / "line.marks").write_text("".join(f"{json.dumps(mark)}\n" for mark in marks))
    (folder / "line.json").write_text(json.dumps({"time": 100, "type": "word", "value": words}))
    (folder / "mouth.tsv").write_text("0.00\tX\n0.10\tA\n0.30\tD\n0.60\tX\n")
    (folder / "my-drawings").mkdir()
    for name in "ABCDEF":
        Image.new("L", (32, 32)).save(folder / "my-drawings" / f"{name}.png")


def _characters(folder: Path) -> None:
    plain = head(shapes=False)
    write_glb(folder / "head.glb", head())
    write_obj(folder / "head.obj", plain)
    rows = "".join(f"{point},{vertex}\n" for point, vertex in lip_points(plain).items())
    (folder / "points.csv").write_text("point,vertex\n" + rows, encoding="utf-8")
