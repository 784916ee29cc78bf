"""Adaptation to unknown speakers from untranscribed recordings: phone accuracy and lip motion before and after.

    python benchmarks/adapt.py [--corpora FOLDER] [--model FILE]

speech-open : recordings with transcripts; the model is adapted to the other recordings of the same voice, or, where
              there are none, to the recording itself; the reference phones are those of forced alignment
grid-others : one clip per speaker; the model is adapted to the clip itself; correlation of the opening with its track
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from robust import SPOKEN, edits, show, spoken

from lipmotion import adapt, animate, load_model
from lipmotion.corpora.layouts import words_of_name
from lipmotion.errors import InputError
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.recogniser import RECOGNISER_KINDS, Recogniser
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio
from lipmotion.units import Lexicon, words_of
from lipmotion_faces.tracking.track import track

VOICES = {
    "LibriVox reader, the 4 others": tuple(name for name in SPOKEN if name.startswith("sense_and")),
    "two of one man, the other": ("acoustic_corpus.wav", "cold_corpus.wav"),
    "itself": tuple(name for name in SPOKEN if name.startswith(("61-", "common"))),
}
"""Recordings, by the recordings that the model is adapted to."""


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--model", type=Path, help="default: the one that ships")
    options = parser.parse_args()
    model = load_model(options.model)
    speech_open(options.corpora / "speech-open", model)
    grid_others(options.corpora / "grid-others", model)


def speech_open(folder: Path, model: Model) -> None:
    """Print the phone accuracies of the recordings with transcripts."""
    total: dict[str, list[tuple[int, int]]] = {}
    for name, files in VOICES.items():
        audios = [read_audio(folder / file) for file in files]
        wanted = [phones_of(model, folder / file) for file in files]
        found: dict[str, list[tuple[int, int]]] = {}
        for i, audio in enumerate(audios):
            learned = [audio] if name == "itself" else [other for j, other in enumerate(audios) if j != i]
            for key, errors in phone_errors(model, adapted_if_possible(model, learned), audio, wanted[i]).items():
                found.setdefault(key, []).append((errors, len(wanted[i])))
        for key, pairs in found.items():
            total.setdefault(key, []).extend(pairs)
        show(f"speech-open, adapted to {name}", **accuracies(found))
    show("speech-open, all", **accuracies(total))


def adapted_if_possible(model: Model, recordings: list[Audio]) -> Model:
    """Return an adapted model, or the model itself if there is too little speech."""
    try:
        return adapt(model, recordings)
    except InputError as error:
        show("speech-open, not adapted", reason=str(error))
        return model


def phone_errors(model: Model, adapted: Model, audio: Audio, wanted: list[str]) -> dict[str, int]:
    """Return the number of phone errors of every recogniser before and after adaptation."""
    features = analysed(audio).mfcc()
    return {
        f"{kind} {when}": edits(
            wanted,
            spoken(
                span.label.phone for span in Recogniser(one.phones, kind, one.adaptation).recognise(audio, features)
            ),
        )
        for kind in RECOGNISER_KINDS
        for when, one in (("before", model), ("after", adapted))
    }


def phones_of(model: Model, path: Path) -> list[str]:
    """Return the phones of a recording's transcript, as the general models align them."""
    text = path.with_suffix(".txt")
    words = words_of((text if text.exists() else path.with_suffix(".lab")).read_text())
    audio = read_audio(path)
    aligned = Recogniser(model.phones, "general").align(audio, analysed(audio).mfcc(), words, Lexicon())
    return spoken(span.label.phone for span in aligned)


def accuracies(found: dict[str, list[tuple[int, int]]]) -> dict[str, object]:
    """Return the number of phones, and the phone accuracies."""
    count = sum(phones for _, phones in next(iter(found.values())))
    values = {key: round(1 - sum(errors for errors, _ in pairs) / count, 3) for key, pairs in found.items()}
    return {"phones": count, **values}


def grid_others(folder: Path, model: Model) -> None:
    """Print the correlation of the opening for five GRID speakers."""
    figures: dict[str, dict[str, float]] = {}
    errors: dict[str, list[tuple[int, int]]] = {}
    for clip in sorted(folder.glob("*.mpg")):
        tracked, audio = track(clip, crops=False), read_audio(clip)
        adapted, words = adapt(model, [audio]), " ".join(words_of_name(clip.stem) or ())
        aligned = Recogniser(model.phones, "general").align(audio, analysed(audio).mfcc(), words.split(), Lexicon())
        wanted = spoken(span.label.phone for span in aligned)
        for key, count in phone_errors(model, adapted, audio, wanted).items():
            errors.setdefault(key, []).append((count, len(wanted)))
        for kind in ("auto", "own"):
            for when, one in (("before", model), ("after", adapted)):
                for condition, text in (("audio only", None), ("with transcript", words)):
                    motion = animate(Request(clip, transcript=text, recogniser=kind), model=one).motion
                    generated = np.interp(tracked.motion.time_s, motion.time_s, motion["opening"])[tracked.seen]
                    seen = tracked.motion["opening"][tracked.seen]
                    row = figures.setdefault(f"{kind}, {condition}, {when}", {})
                    row[clip.stem] = round(float(np.corrcoef(generated, seen)[0, 1]), 3)
    show("grid-others, adapted to itself: phones", **accuracies(errors))
    for key, row in figures.items():
        show(f"grid-others, {key}: ACC opening", mean=round(float(np.mean(list(row.values()))), 3), **row)


if __name__ == "__main__":
    main()
