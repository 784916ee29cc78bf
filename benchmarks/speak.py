"""Text to video: time of the whole process, closed lips, and how often the rule of word stress agrees with espeak-ng.

    python benchmarks/speak.py [--runs 5] [--sentences 60]

One JSON object a line. ``whole_process_s``: wall time of ``lipmotion speak`` of ten words to an mp4, median of the runs
after the first; ``processor_s``: mean time of the processor, which other work on the machine does not lengthen much;
``load``: processes that wanted to run in the last minute. ``closed``: of the p, b and m in the
sentences of ``lipmotion corpus prompts``, how many have a frame whose opening is under 10 % of the 95th percentile, the
bound of docs/measures.md. ``stress``: share of the vowels of these sentences of which ``units.stress`` says what
espeak-ng 1.52 says, in words of several syllables and in words of one; of the former also the share of the words whose
stressed vowel is the same.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from itertools import groupby
from pathlib import Path

import numpy as np

import lipmotion
from lipmotion.pipeline.training.prompts import prompts
from lipmotion.speech.voices import espeak
from lipmotion.speech.voices.installed import default_voice, speak_sentence
from lipmotion.speech.voices.phone_maps import ESPEAK_PHONES
from lipmotion.speech.voices.programs import program_output
from lipmotion.types import Unit
from lipmotion.units import LIP_CLOSING, phone_classes
from lipmotion.units.stress import stress_of

TEN_WORDS = "Please bring my mother the blue ball before the party."
VOWELS = phone_classes()["vowel"] | {"el"}


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--sentences", type=int, default=60)
    options = parser.parse_args()
    print(json.dumps(whole_process(options.runs)), flush=True)
    texts = [prompt.text for prompt in prompts(count=options.sentences).chosen]
    print(json.dumps(closures(texts)), flush=True)
    if espeak.wheel_folder() is not None:
        print(json.dumps(stress(texts)))


def whole_process(runs: int) -> dict[str, object]:
    """Return the time from the command to the finished video."""
    taken_s = []
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "lipmotion.cli.main", "speak", TEN_WORDS, "-o", str(Path(folder) / "a.mp4")]
        for _ in range(runs + 1):
            before_s = time.perf_counter()
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            taken_s.append(time.perf_counter() - before_s)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "voice": default_voice().full_name,
        "whole_process_s": round(statistics.median(taken_s[1:]), 2),
        "least_s": round(min(taken_s), 2),
        "most_s": round(max(taken_s), 2),
        "processor_s": round((spent.ru_utime + spent.ru_stime) / (runs + 1), 2),
        "load": round(os.getloadavg()[0], 1),
    }


def closures(texts: list[str]) -> dict[str, object]:
    """Return how many p, b and m close the lips."""
    count = closed = 0
    for text in texts:
        result = lipmotion.speak(text).generation
        opening = result.motion["opening"]
        bound = 0.1 * np.percentile(opening, 95)
        for span in result.units:
            if span.label.phone in LIP_CLOSING:
                count += 1
                closed += bool(opening[round(span.start_s * 100) : round(span.end_s * 100) + 1].min() < bound)
    return {"sentences": len(texts), "p b m": count, "closed": closed}


def stress(texts: list[str]) -> dict[str, object]:
    """Return how often the rule says of a vowel what espeak-ng says."""
    several: list[bool] = []
    single: list[bool] = []
    words: list[bool] = []
    with tempfile.TemporaryDirectory() as folder:
        task = {"voice": espeak.LANGUAGE, "texts": texts, "folder": folder} | espeak._library()
        answers = json.loads(program_output(espeak.PROGRAM, espeak.PACKAGE, len(texts), json.dumps(task)))
    voice = next(voice for voice in espeak.ESPEAK_NG.others() if voice.name == espeak.LANGUAGE)
    for text, said in zip(texts, answers, strict=True):
        marks = ["'" in label for label, _, _ in said for name in ESPEAK_PHONES[label.lstrip("',")] if name in VOWELS]
        units = speak_sentence(text, voice)[1]
        ours = [
            (span.label.word, mark) for span, mark in zip(units, stress_of(units), strict=True) if is_vowel(span.label)
        ]
        if len(ours) != len(marks):
            continue
        for word, group in groupby(zip(ours, marks, strict=True), key=lambda pair: pair[0][0]):
            pairs = [(mark == 1, theirs) for (_, mark), theirs in group]
            agree = [mine == theirs for mine, theirs in pairs]
            (several if len(pairs) > 1 else single).extend(agree)
            if len(pairs) > 1 and word:
                words.append(all(agree))
    return {
        "vowels of longer words": [len(several), share(several)],
        "longer words": [len(words), share(words)],
        "words of one vowel": [len(single), share(single)],
    }


def share(agree: list[bool]) -> float | None:
    """Return the share of those that agree; None: there are none."""
    return round(float(np.mean(agree)), 3) if agree else None


def is_vowel(unit: Unit) -> bool:
    """Return whether a unit is a vowel, or the l of *table*."""
    return unit.phone in VOWELS


if __name__ == "__main__":
    main()
