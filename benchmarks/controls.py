"""Held poses, intensity and the shape D of cues, on ten spoken sentences.

    python benchmarks/controls.py

Needs a synthetic voice (extra ``text``). Held poses stand beside plain sampling: every second frame of 24 a
second, held twice.
"""

from __future__ import annotations

import json
import time
from collections import Counter

import numpy as np
from character import SENTENCES

import lipmotion
from lipmotion.articulation.delivery import Delivery, closed_on_grid, closed_times, held, intensified
from lipmotion.types import Generation

RATE_HZ = 24.0
VOICES = ("espeak-ng:en-us+f2", "espeak-ng:en-us+m1", "espeak-ng:en-us+m7", "espeak-ng:en-gb")
CLOSED_OPENING = 0.012
"""Lips that touch have openings up to this (``meshes.fitting.point_motion``)."""


def main() -> None:
    """Print one JSON object a figure."""
    spoken = [lipmotion.speak(text, voice=VOICES[0]).generation for text in SENTENCES]
    held_poses(spoken)
    for intensity in (0.5, 1.5, 2.0, 3.0):
        larger(spoken, intensity)
    for voice in VOICES:
        shapes(voice)


def held_poses(spoken: list[Generation]) -> None:
    """Print how far held poses and sampled ones are from the curves, and how many closures they show."""
    frames = Delivery(stepped=True).hold_frames(RATE_HZ)
    errors, sampled_errors, shown, sampled_shown, count, seconds = [], [], 0, 0, 0, 0.0
    for each in spoken:
        closed_s = closed_times(each)
        curve = each.resampled(RATE_HZ)
        start = time.process_time()
        steps = held(closed_on_grid(each, RATE_HZ).resampled(RATE_HZ), frames, closed_s).motion["opening"]
        seconds += time.process_time() - start
        sampled = np.repeat(curve.motion["opening"][::frames], frames)[: len(curve.motion.values)]
        errors.append(steps - curve.motion["opening"])
        sampled_errors.append(sampled - curve.motion["opening"])
        at = [min(round(time_s * RATE_HZ), len(steps) - 1) for time_s in closed_s]
        count += len(at)
        shown += int((steps[at] <= CLOSED_OPENING).sum())
        sampled_shown += int((sampled[at] <= CLOSED_OPENING).sum())
    figures = {"poses of at least frames": frames, "rate": RATE_HZ, "p b m": count}
    for way, found, closed in (("held", errors, shown), ("sampled", sampled_errors, sampled_shown)):
        rms = float(np.sqrt(np.mean(np.concatenate(found) ** 2)))
        print(json.dumps({"way": way, "rms of opening": round(rms, 4), "closed": closed, **figures}))
    spoken_s = sum(float(each.motion.time_s[-1]) for each in spoken)
    print(json.dumps({"figure": "processor seconds a minute of speech", "value": round(60 * seconds / spoken_s, 4)}))


def larger(spoken: list[Generation], intensity: float) -> None:
    """Print how much larger the movements are, how far closures move, and how much more points and opening disagree."""
    ratios, closures, points = [], [], []
    for each in spoken:
        after, before = intensified(each, intensity).motion, each.motion
        ratios.append(float(np.std(after["opening"]) / np.std(before["opening"])))
        frames = [each.frame for each in closures(each.motion, each.units)]
        closures.append(float(np.abs(after["opening"][frames] - before["opening"][frames]).max(initial=0.0)))
        apart = [
            float(np.abs(np.hypot(*(m[f"{axis}_13"] - m[f"{axis}_14"] for axis in "xy")) - m["opening"]).max())
            for m in (before, after)
        ]
        points.append(apart[1] - apart[0])
    figures = {"ratio of deviations": float(np.mean(ratios)), "closures move": max(closures), "points": max(points)}
    print(json.dumps({"intensity": intensity, **{name: round(value, 5) for name, value in figures.items()}}))


def shapes(voice: str) -> None:
    """Print the share of each shape of cues, and how many aa are D."""
    share: Counter[str] = Counter()
    vowels: Counter[str] = Counter()
    for text in SENTENCES:
        result = lipmotion.speak(text, voice=voice).generation
        sheet = lipmotion.cues(result)
        for cue in sheet.cues:
            share[cue.label] += round(100 * cue.duration_s)
        for span in result.units:
            if span.label.phone == "aa":
                seen = {c.label for c in sheet.cues if c.end_s > span.start_s + 0.01 and c.start_s < span.end_s - 0.01}
                vowels["D" if "D" in seen else "another"] += 1
    spoken = sum(count for shape, count in share.items() if shape != "X")
    shares = {shape: round(100 * count / spoken, 1) for shape, count in sorted(share.items()) if shape != "X"}
    words = {word: "".join(c.label for c in lipmotion.cues(lipmotion.speak(word, voice=voice).generation).cues)
             for word in ("father", "mama")}  # fmt: skip
    print(json.dumps({"voice": voice, "per cent": shares, "aa": dict(vowels), **words}))


if __name__ == "__main__":
    main()
