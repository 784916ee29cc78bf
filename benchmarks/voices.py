"""Installed synthetic voices: amount of speech, speed, and agreement of their phone times with forced alignment.

    python benchmarks/voices.py [--sentences 60]

One JSON object per synthesiser, then one for all. ``late_ms``: median of (its start of a phone − the start that the
general phone models align); ``off_ms``, ``worst_ms``: median and 90th percentile of the distance. ``biased``: phones
whose median difference (of 20 or more) is at least 12 ms.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np

import lipmotion
from lipmotion.errors import AlignmentError
from lipmotion.pipeline.training.other_speakers import (
    SpokenSentence,
    is_held_out_speaker,
    synthetic_sentences,
    voice_examples,
)
from lipmotion.pipeline.training.prompts import prompts
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.voices.installed import installed_voices
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import is_silent

FEWEST_PHONES, BIASED_MS = 20, 12


def main() -> None:
    """Print one JSON object per synthesiser, and those of all voices."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sentences", type=int, default=60)
    texts = [prompt.text for prompt in prompts(count=parser.parse_args().sentences).chosen]
    general = Recogniser(lipmotion.load_model().phones, "general")
    everything: list[SpokenSentence] = []
    total_s = 0.0
    for name in dict.fromkeys(voice.synthesiser for voice in installed_voices()):
        voices = [voice for voice in installed_voices() if voice.synthesiser == name]
        before_s = time.perf_counter()
        sentences = list(synthetic_sentences(texts, voices))
        count = sum(1 for _ in voice_examples(sentences))
        taken_s = time.perf_counter() - before_s
        size = {"synthesiser": name, "voices": len(voices), "sentences": count, "minutes": minutes(sentences)}
        print(json.dumps(size | {"seconds": round(taken_s, 1)} | start_differences(sentences, general)))
        everything += sentences
        total_s += taken_s
    speakers = dict.fromkeys(sentence.speaker for sentence in everything)
    counts = Counter(span.label.phone for sentence in everything for span in sentence.phones)
    print(
        json.dumps({"minutes": minutes(everything), "seconds": round(total_s, 1), "phones": dict(counts.most_common())})
    )
    print(
        json.dumps(
            {"speakers": list(speakers), "for judging": [name for name in speakers if is_held_out_speaker(name)]}
        )
    )


def minutes(sentences: Sequence[SpokenSentence]) -> float:
    """Return the total duration of sentences in minutes."""
    return round(sum(sentence.audio.duration_s for sentence in sentences) / 60, 1)


def start_differences(sentences: Sequence[SpokenSentence], general: Recogniser) -> dict[str, object]:
    """Return by how much phones start later than in the alignment of the general models."""
    late_ms, misfits = defaultdict(list), 0
    for sentence in sentences:
        try:
            placed = general.align_phones(sentence.audio, analysed(sentence.audio).mfcc(), sentence.phones)
        except AlignmentError:
            misfits += 1
            continue
        for stated, found in zip(without_silence(sentence.phones), without_silence(placed), strict=True):
            late_ms[stated.label.phone].append(1000 * (stated.start_s - found.start_s))
    errors = np.concatenate(list(late_ms.values()))
    medians = {
        phone: round(float(np.median(values))) for phone, values in late_ms.items() if len(values) >= FEWEST_PHONES
    }
    return {
        "phones": len(errors),
        "misfits": misfits,
        "late_ms": round(float(np.median(errors)), 1),
        "off_ms": round(float(np.median(np.abs(errors))), 1),
        "worst_ms": round(float(np.quantile(np.abs(errors), 0.9)), 1),
        "biased": {phone: median for phone, median in sorted(medians.items()) if abs(median) >= BIASED_MS},
    }


def without_silence(units: Timeline[Unit]) -> list[Span[Unit]]:
    """Return the spans of phones without silence."""
    return [span for span in units if not is_silent(span.label.phone)]


if __name__ == "__main__":
    main()
