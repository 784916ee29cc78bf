"""Benefit of a second stage of training, on speech of other speakers without motion, for coupled models.

    python benchmarks/two_stage.py --corpus build/grid-s1 --phones build/grid-s1-train.lipmotion --talkers VIDEO ...
        [--strangers VIDEO ...] [--tracks FOLDER] [--clips 50] [--sentences 5] [--only everyone ...]

Phones of the corpus are aligned by the phone models of ``--phones``, which was not trained on the validation list.
Other speakers are synthetic voices, the transcribed recordings of ``speech-open`` (general phone models align them),
and the sound of talkers, without transcripts: what the shipped model recognises of it, at most two minutes of each.

One JSON object per line and model. ``own``: ACC of the opening on the validation list of the corpus; ``GRID``: its mean
over the clips of grid-others, audio only and with words, as it is and at the best lag within 60 ms; ``open``: that of
each of the other strangers, audio only, at the best lag within 120 ms; ``phones``: for held-out speakers, the share of
frames of speech whose most probable phone is the labelled one, and the same for visemes, without transcripts.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from anyone import best_lag, compared, correlations
from kept_tracks import kept_track
from transfer import cuts_at_pauses

import lipmotion
from lipmotion.corpora.layouts import words_of_name
from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import engine_named
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.motion.resample import model_motion
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.training.other_speakers import (
    VoiceExample,
    is_held_out_speaker,
    recorded_sentences,
    synthetic_sentences,
    voice_examples,
)
from lipmotion.pipeline.training.prompts import prompts
from lipmotion.pipeline.training.train import examples_without_motion
from lipmotion.pipeline.understand.understood_speech import understand
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.installed import installed_voices
from lipmotion.types import Audio, Example, Speech, Timeline, Unit, Utterance, silent_monitor
from lipmotion.units import VISEME_OF, Lexicon, is_silent
from lipmotion_lab.evaluation.evaluate import evaluate

SENTENCES, HELD_OUT_SENTENCES = 60, 15
"""Number of sentences; the last of them are held out from training, to test with."""
OPEN = {"sense_and_*": "austen-reader", "*_corpus": "michael", "common_voice_en_*": "common-voice"}
SOUND_S = 120.0
"""Seconds of each talker."""
EVERYONE, REAL = "voices recordings talkers", "recordings talkers"
MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "one stage": ("", {}),
    "one stage, 8 Gaussians": ("", {"mixtures": 8}),
    "synthetic": ("voices", {}),
    "real": (REAL, {}),
    "everyone": (EVERYONE, {}),
    "synthetic, 4 Gaussians": ("voices", {"speech_only_mixtures": 4}),
    "real, 4 Gaussians": (REAL, {"speech_only_mixtures": 4}),
    "everyone, 4 Gaussians": (EVERYONE, {"speech_only_mixtures": 4}),
}
"""Kinds of other speakers, and options, by name; two stages wherever there are others."""


def main() -> None:
    """Print one JSON object per model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"))
    parser.add_argument("--phones", type=Path, default=Path("build/grid-s1-train.lipmotion"))
    parser.add_argument("--talkers", type=Path, nargs="*", default=[], help="sound or videos, to train on")
    parser.add_argument("--strangers", type=Path, nargs="*", default=[], help="videos, to judge lips with")
    parser.add_argument("--tracks", type=Path, help="folder in which tracks of strangers are kept")
    parser.add_argument("--clips", type=int, default=100)
    parser.add_argument("--sentences", type=int, default=15, help="in each synthetic voice")
    parser.add_argument("--only", action="append", choices=list(MODELS), help="repeatable; default: all")
    options = parser.parse_args()
    corpus, phones = Corpus.open(options.corpus), lipmotion.load_model(options.phones).phones
    names = corpus.names("train")
    utterances = [corpus.utterance(name) for name in names[:: max(len(names) // options.clips, 1)][: options.clips]]
    examples = [example(one, Recogniser(phones)) for one in utterances]
    others, held_out = speakers(options.corpora, options.sentences, options.talkers)
    grid = sorted((options.corpora / "grid-others").glob("*.mpg"))
    said = {"GRID s1, val": [corpus.utterance(name) for name in corpus.names("val")]}
    said["GRID, five others"] = [grid_utterance(path, options.tracks) for path in grid]
    held_out |= {who: [aligned(each, Recogniser(phones)) for each in listed] for who, listed in said.items()}
    for name in options.only or MODELS:
        kinds, config = MODELS[name]
        more = [one for kind in kinds.split() for one in others[kind]]
        engine = engine_named("coupled", {"mixtures": 4} | config)
        started_s = time.process_time()
        fit = engine.fit([*examples, *examples_without_motion(engine, more)], silent_monitor)
        model, minutes = Model(phones, engine, fit.model, {}), sum(one.features.duration_s for one in more) / 60
        figures: dict[str, Any] = {"seconds": round(time.process_time() - started_s)}
        figures |= {"minutes of others": round(minutes, 1), "speakers": len({one.speaker for one in more})}
        figures |= {"own": own_acc(model, corpus), "GRID": grid_acc(model, said["GRID, five others"])}
        figures["open"] = {path.stem: open_acc(model, path, options.tracks) for path in options.strangers}
        row = {"model": name, "clips": len(examples)} | figures
        row["phones"] = {who: frame_accuracy(fit.model, speech) for who, speech in held_out.items()}
        print(json.dumps(row), flush=True)


def speakers(
    corpora: Path, count: int, talkers: Sequence[Path]
) -> tuple[dict[str, list[VoiceExample]], dict[str, list[VoiceExample]]]:
    """Return the training speech by kind, and the held-out speech by speaker."""
    texts = [prompt.text for prompt in prompts(count=SENTENCES).chosen]
    learned = [voice for voice in installed_voices() if not is_held_out_speaker(voice.speaker)]
    judging = [voice for voice in installed_voices() if is_held_out_speaker(voice.speaker)]
    general = Recogniser(lipmotion.load_model().phones, "general")
    recordings = list(voice_examples(recorded_sentences(corpora / "speech-open", general, speakers=OPEN)))
    others = {
        "voices": list(
            voice_examples(synthetic_sentences(texts[: min(count, SENTENCES - HELD_OUT_SENTENCES)], learned))
        ),
        "recordings": [one for one in recordings if not is_held_out_speaker(one.speaker)],
        "talkers": [one for path in talkers for one in recognised(path)],
    }
    held_out: dict[str, list[VoiceExample]] = {}
    for one in (*voice_examples(synthetic_sentences(texts[-HELD_OUT_SENTENCES:], judging)), *recordings):
        if is_held_out_speaker(one.speaker):
            held_out.setdefault(one.speaker, []).append(one)
    return others, held_out


def recognised(path: Path) -> Iterator[VoiceExample]:
    """Yield the speech of a talker, divided at pauses, with the phones that the shipped model recognises."""
    model, audio = lipmotion.load_model(), read_audio(path)
    audio = Audio(audio.samples[: round(SOUND_S * audio.rate_hz)], audio.rate_hz)
    for first_s, last_s in pairwise(cuts_at_pauses(audio)):
        samples = audio.samples[round(first_s * audio.rate_hz) : round(last_s * audio.rate_hz)]
        speech = understand(model, Request(Audio(samples, audio.rate_hz)))
        yield VoiceExample(speech.features, speech.units, path.stem)


def example(utterance: Utterance, phones: Recogniser) -> Example:
    """Return an utterance as a training example."""
    motion, valid = model_motion(utterance.track, len(utterance.features.values))
    return Example(utterance.name, Speech(*aligned(utterance, phones)[:2]), motion, valid)


def aligned(utterance: Utterance, phones: Recogniser) -> VoiceExample:
    """Return an utterance of GRID with aligned phones."""
    features, words = analysed(utterance.audio).mfcc(), utterance.words or words_of_name(utterance.name)
    return VoiceExample(features, phones.align(utterance.audio, features, words or (), Lexicon()), utterance.speaker)


def own_acc(model: Model, corpus: Corpus) -> dict[str, float]:
    """Return the ACC of opening on the validation list, by condition."""
    conditions = evaluate(model, corpus, selection=Selection("val"))["conditions"]
    return {name: round(found["channels"]["opening"]["acc"], 3) for name, found in conditions.items()}


def grid_utterance(path: Path, tracks: Path | None) -> Utterance:
    """Return a clip of GRID."""
    audio, words = read_audio(path), words_of_name(path.stem)
    return Utterance(path.stem, audio, analysed(audio).mfcc(), kept_track(path, tracks), words, "test", {}, path.stem)


def grid_acc(model: Model, clips: Sequence[Utterance]) -> dict[str, float]:
    """Return the mean ACC of the opening over clips of GRID, by condition, as it is and at the best lag."""
    found: dict[str, list[float]] = defaultdict(list)
    for one in clips:
        for condition, words in (("audio only", None), ("with transcript", " ".join(one.words or ()))):
            motion = lipmotion.animate(one.audio, transcript=words, model=model).motion
            found[condition].append(correlations(*compared(motion, one.track))["opening"])
            found[f"{condition}, best lag"].append(best_lag(motion, one.track, 0.06)["opening"])
    return {condition: round(float(np.mean(values)), 3) for condition, values in found.items()}


def open_acc(model: Model, path: Path, tracks: Path | None) -> float:
    """Return the ACC of the opening in a video, audio only, at the best lag."""
    motion = lipmotion.animate(read_audio(path), model=model).motion
    return round(best_lag(motion, kept_track(path, tracks), 0.12)["opening"], 3)


def frame_accuracy(model: CoupledModel, said: Sequence[VoiceExample]) -> tuple[float, float]:
    """Return the shares of frames of speech whose most probable phone, and viseme, is the labelled one."""
    structure = model.chains.structure
    visemes = np.array([VISEME_OF[structure.chains[0].phones(unit)[0]] for unit in structure.units[0]])
    kinds, kind = np.unique(visemes, return_inverse=True)
    member = np.eye(len(kinds))[kind]
    found: list[tuple[bool, bool]] = []
    for one in said:
        observations = model.speech_observations(np.asarray(one.features.values))
        emissions = model.chains.emission_log_densities(observations, model.chains.full_lattice)
        states = model.chains.posteriors(emissions, model.chains.full_lattice).chains[0]
        units = states.reshape(len(states), len(kind), -1).sum(axis=2)
        unit, viseme = units.argmax(axis=1), (units @ member).argmax(axis=1)
        for frame, number in frame_units(one.units, len(units), structure):
            found.append((unit[frame] == number, viseme[frame] == kind[number]))
    phones, looks = np.mean(found, axis=0)
    return round(float(phones), 3), round(float(looks), 3)


def frame_units(units: Timeline[Unit], frames: int, structure: Any) -> Iterable[tuple[int, int]]:
    """Yield every frame of speech and the number of its unit."""
    for span in units:
        if not is_silent(span.label.phone):
            number = structure.units[0].index(structure.chains[0].unit(span.label.phone))
            for frame in range(int(np.ceil(100 * span.start_s)), min(int(np.ceil(100 * span.end_s)), frames)):
                yield frame, number


if __name__ == "__main__":
    main()
