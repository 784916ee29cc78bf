"""Benefit of a second stage of training, on speech of other speakers without motion, for coupled models.

    lipmotion corpus prepare ../shared/corpora/grid-others -o build/grid-others
    python benchmarks/two_stage.py [--clips 100] [--sentences 15] [--only "two stages" ...]

Phones of GRID are aligned by the phone models of build/grid-s1-train.lipmotion (``make model``; it was not trained on
the validation list).

One JSON object per line and model. ``own``: ACC of the opening on the validation list of build/grid-s1; ``strangers``:
its mean over the clips of build/grid-others; ``phones``: for held-out speakers, the share of frames of speech whose
most probable phone is the labelled one, and the same for visemes, without transcripts.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import lipmotion
from lipmotion.corpora.grid import words_of_name
from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import engine_named
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.pipeline.corpus.prompts import prompts
from lipmotion.pipeline.evaluation.evaluate import evaluate
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.training.other_speakers import (
    VoiceExample,
    is_held_out_speaker,
    recorded_sentences,
    synthetic_sentences,
    voice_examples,
)
from lipmotion.pipeline.training.train import examples_without_motion, model_motion
from lipmotion.speech.features.mfcc import mfcc
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.voices.installed import installed_voices
from lipmotion.types import Example, Speech, Timeline, Unit, Utterance, silent_monitor
from lipmotion.units import VISEME_OF, Lexicon, is_silent

SENTENCES, HELD_OUT_SENTENCES = 60, 15
"""Number of sentences; the last of them are held out from training, to test with."""
OPEN = {"sense_and_*": "austen-reader", "*_corpus": "michael", "common_voice_en_*": "common-voice"}
MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "one stage": ("", {}),
    "one stage, 8 Gaussians": ("", {"mixtures": 8}),
    "one stage, 16 Gaussians": ("", {"mixtures": 16}),
    "two stages": ("voices recordings", {}),
    "two stages, weight 1": ("voices recordings", {"speech_only_weight": 1.0}),
    "two stages, weight 0.1": ("voices recordings", {"speech_only_weight": 0.1}),
    "two stages, 4 Gaussians": ("voices recordings", {"speech_only_mixtures": 4}),
    "two stages, 16 Gaussians": ("voices recordings", {"speech_only_mixtures": 16}),
    "two stages, 2 steps": ("voices recordings", {"speech_only_steps": 2}),
    "two stages, recordings only": ("recordings", {}),
    "two stages, voices only": ("voices", {}),
}


def main() -> None:
    """Print one JSON object per model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--other-speakers", type=Path, default=Path("build/grid-others"))
    parser.add_argument("--clips", type=int, default=100)
    parser.add_argument("--sentences", type=int, default=15, help="in each synthetic voice")
    parser.add_argument("--only", action="append", choices=list(MODELS), help="repeatable; default: all")
    options = parser.parse_args()
    corpus, other_speakers = Corpus.open("build/grid-s1"), Corpus.open(options.other_speakers)
    names = corpus.names("train")
    utterances = [corpus.utterance(name) for name in names[:: max(len(names) // options.clips, 1)][: options.clips]]
    phones = lipmotion.load_model("build/grid-s1-train.lipmotion").phones
    examples = [example(one, Recogniser(phones)) for one in utterances]
    others, held_out = speakers(options.corpora, options.sentences)
    for who, listed in (("GRID s1, val", corpus.names("val")), ("GRID, five others", other_speakers.names(None))):
        known = corpus if "s1" in who else other_speakers
        held_out[who] = [aligned(known.utterance(name), Recogniser(phones)) for name in listed]
    for name in options.only or MODELS:
        kinds, config = MODELS[name]
        more = [one for kind in kinds.split() for one in others[kind]]
        engine = engine_named("coupled", {"mixtures": 4} | config)
        started_s = time.perf_counter()
        fit = engine.fit([*examples, *examples_without_motion(engine, more)], silent_monitor)
        model, minutes = Model(phones, engine, fit.model, {}), sum(one.features.duration_s for one in more) / 60
        figures = {"seconds": round(time.perf_counter() - started_s), "minutes of others": round(minutes, 1)}
        figures |= {"own": own_acc(model, corpus), "strangers": other_speakers_acc(model, other_speakers)}
        row = {"model": name, "clips": len(examples)} | figures
        row["phones"] = {who: frame_accuracy(fit.model, speech) for who, speech in held_out.items()}
        print(json.dumps(row), flush=True)


def speakers(corpora: Path, count: int) -> tuple[dict[str, list[VoiceExample]], dict[str, list[VoiceExample]]]:
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
    }
    held_out: dict[str, list[VoiceExample]] = {}
    for one in (*voice_examples(synthetic_sentences(texts[-HELD_OUT_SENTENCES:], judging)), *recordings):
        if is_held_out_speaker(one.speaker):
            held_out.setdefault(one.speaker, []).append(one)
    return others, held_out


def example(utterance: Utterance, phones: Recogniser) -> Example:
    """Return an utterance as a training example."""
    motion, valid = model_motion(utterance.track, len(utterance.features.values))
    return Example(utterance.name, Speech(*aligned(utterance, phones)[:2]), motion, valid)


def aligned(utterance: Utterance, phones: Recogniser) -> VoiceExample:
    """Return an utterance of GRID with aligned phones."""
    features, words = mfcc(utterance.audio), utterance.words or words_of_name(utterance.name)
    return VoiceExample(features, phones.align(utterance.audio, features, words or (), Lexicon()), utterance.speaker)


def own_acc(model: Model, corpus: Corpus) -> dict[str, float]:
    """Return the ACC of opening on the validation list, by condition."""
    conditions = evaluate(model, corpus, selection=Selection("val"))["conditions"]
    return {name: round(found["channels"]["opening"]["acc"], 3) for name, found in conditions.items()}


def other_speakers_acc(model: Model, other_speakers: Corpus) -> dict[str, float]:
    """Return the mean ACC of the opening over clips of other speakers, by condition."""
    found: dict[str, list[float]] = {"audio only": [], "with transcript": []}
    for name in other_speakers.names(None):
        one = other_speakers.utterance(name)
        seen, recorded = np.asarray(one.track.seen), one.track.motion
        for condition, words in (
            ("audio only", None),
            ("with transcript", " ".join(one.words or words_of_name(name) or ())),
        ):
            motion = lipmotion.animate(one.audio, transcript=words, model=model).motion
            generated = np.interp(recorded.time_s, motion.time_s, motion["opening"])
            found[condition].append(float(np.corrcoef(generated[seen], recorded["opening"][seen])[0, 1]))
    return {condition: round(float(np.mean(values)), 3) for condition, values in found.items()}


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
