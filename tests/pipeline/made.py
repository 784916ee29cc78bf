"""What tests of several rooms make and read: corpora, sounds and their features, recognisers, characters, moods."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.io import wavfile

from lipmotion import Corpus, Model
from lipmotion.articulation.expression import with_moods
from lipmotion.errors import MissingDependencyError
from lipmotion.pipeline.outputs.output import OutputSettings, Performance
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Features, Generation, Motion, Timeline, Track, Unit, Utterance
from lipmotion.types.delivery import parse_moods
from lipmotion_faces.characters.character_files import load_character
from lipmotion_faces.corpus import prepare
from lipmotion_faces.outputs.shown_faces import shown_face
from testing.toy import toy_sentences, toy_utterances


def corpus_of(folder: Path, utterances: Iterable[Utterance]) -> Corpus:
    corpus = Corpus.create(folder)
    for utterance in utterances:
        corpus.add(utterance)
    return corpus


WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"
GAIN, OFFSET = np.array([0.5, 1.2, 0.6]), np.array([0.04, -0.05, 0.1])
"""How ben's opening, width and outer differ from those of the toy: he never closes his mouth wholly."""


def of_ben(utterance: Utterance) -> Utterance:
    motion = utterance.track.motion
    changed = replace(motion, values=OFFSET + GAIN * motion.values)
    return replace(utterance, track=replace(utterance.track, motion=changed), speaker="ben")


def people(count: int = 12, seed: int = 0) -> list[Utterance]:
    """Return sentences of the toy; every other one is ben's, the others are anna's."""
    said = enumerate(toy_utterances(count, seed=seed))
    return [of_ben(each) if number % 2 else replace(each, speaker="anna") for number, each in said]


def true_phones(utterance: Utterance, names: Mapping[str, str] = MappingProxyType({})) -> Timeline[Unit]:
    """Return the phones of a toy utterance, some of them under other names."""
    (units,) = (each.units for each in toy_sentences(12) if each.name == utterance.name)
    return Timeline(tuple(replace(s, label=Unit(names.get(s.label.phone, s.label.phone))) for s in units))


def replace_tracking(monkeypatch: pytest.MonkeyPatch, track: Callable[..., Track] | None) -> None:
    """Let a function track videos that are prepared; None: the packages for video are missing."""

    def versions() -> dict[str, str]:
        if track is None:
            raise MissingDependencyError("pip install")
        return {"mediapipe": "0", "opencv": "4", "av": "1"}

    monkeypatch.setattr(prepare, "make_tracker", lambda _: SimpleNamespace(list_versions=versions))
    monkeypatch.setattr(prepare, "track", track)


def features_of(audio: Audio) -> Features:
    return analysed(audio).mfcc()


def read_sound(sound: Path | Audio) -> AnalysedAudio:
    return analysed(sound if isinstance(sound, Audio) else read_audio(sound))


def read_welcome() -> AnalysedAudio:
    """Return real speech of five seconds, of a voice that the shipped model does not know."""
    return read_sound(WELCOME)


def recogniser_of(model: Model, kind: str = "own") -> Recogniser:
    return Recogniser(model.phones, kind)


def read_character(path: Path, points: Path | None = None) -> Any:
    return load_character(path, points=points)


def in_mood(motion: Motion, mood: str) -> Motion:
    return with_moods(motion, parse_moods(mood))


def performed(generation: Generation, face: str, **settings: Any) -> Performance:
    return Performance(generation, OutputSettings(shown_face(face), **settings))


def write_sound(path: Path, audio: Audio) -> None:
    """Write samples as a WAV file of 16 bits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    wavfile.write(path, audio.rate_hz, np.round(np.clip(audio.samples, -1, 1) * 32_767).astype("<i2"))


def write_noise(path: Path, seconds: float = 1.0, seed: int = 0, rate_hz: int = 16_000) -> None:
    """Write noise as a WAV file, whatever its suffix is."""
    samples = np.random.default_rng(seed).integers(-9000, 9000, int(seconds * rate_hz))
    write_sound(path, Audio((samples / 32_767).astype(np.float32), rate_hz))
