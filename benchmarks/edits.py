"""Time and memory of edits in a session, by kind of edit: ``python benchmarks/edits.py RECORDING [SECONDS ...]``.

Each edit is made in a session whose motion is known, as a user makes it: phones of its middle are changed. The time is
the median of several edits that differ, in seconds by the clock; the first motion of the session stands beside it.
"""

from __future__ import annotations

import json
import resource
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import lipmotion
from lipmotion.pipeline.session import Session
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio

TIMES = 7


def timed(make: Callable[[], object]) -> float:
    """Return how long a function takes, in seconds."""
    start_s = time.perf_counter()
    make()
    return time.perf_counter() - start_s


def sentences(session: Session, duration_s: float) -> dict[str, list[str]]:
    """Return edits that differ, by kind: phones from the middle of the recording on."""
    units = list(session.units())
    middle = len(units) // 2
    spoken = [n for n in range(middle, len(units) - 1) if units[n].label.phone != "sil"][:TIMES]
    return {
        "another phone": [f"phone {n + 1} is {'aa' if units[n].label.phone != 'aa' else 'iy'}" for n in spoken],
        "a moved border": [f"phone {n + 1} ends {(units[n].start_s + 3 * units[n].end_s) / 4:.4f}" for n in spoken],
        "another word": [f"word {n + 3} is baby" for n in range(TIMES)],
        "a pin of the opening": [f"pin opening 0.05 at {duration_s / 2 + n / 10:.2f}" for n in range(TIMES)],
        "a pin of jawOpen": [f"pin jawOpen 0.3 at {duration_s / 2 + n / 10:.2f}" for n in range(TIMES)],
        "a gain of a second": [
            f"gain 1.3 from {duration_s / 2 + n:.2f} to {duration_s / 2 + n + 1:.2f}" for n in range(TIMES)
        ],
        "intensity": [f"set intensity {1.1 + n / 10:.1f}" for n in range(TIMES)],
    }  # fmt: skip


def measured(audio: Audio) -> dict[str, float]:
    """Return milliseconds of the first motion, and of each kind of edit."""
    model = lipmotion.load_model()
    lipmotion.animate(lipmotion.Request(audio, recogniser="fast"), model=model)  # kernels are loaded
    session = Session(lipmotion.Request(audio), model=model)
    pictures = lipmotion.SessionPictures(session)
    found = {"first motion": timed(session.generated)}
    warm = [timed(lambda n=n: session.generated(lipmotion.Edits().then(f"pin width 1 at {n + 1}"))) for n in range(4)]
    found["the slowest of the first edits, which loads kernels"] = max(warm)
    found["undo of the last edit"] = timed(lambda: session.generated(lipmotion.Edits().then("pin width 1 at 3")))
    for kind, edits in sentences(session, audio.duration_s).items():
        first, times_s = lipmotion.Edits(), []
        for sentence in edits:
            try:
                times_s.append(timed(lambda: session.delivered(first.then(sentence))))  # noqa: B023 # called at once
            except lipmotion.errors.InputError as error:
                print(f"{sentence}: {error}", file=sys.stderr)
        if times_s:
            found[kind] = statistics.median(times_s)
    others = sentences(session, audio.duration_s)["another phone"]
    found["first picture of the portrait"] = timed(lambda: pictures.picture(audio.duration_s / 2))
    found["another picture"] = timed(lambda: pictures.picture(audio.duration_s / 2 + 1))
    edited = [lipmotion.Edits().then(*others[:count]) for count in range(2, 6)]
    found["a picture after another phone"] = statistics.median(
        timed(lambda: pictures.picture(audio.duration_s / 2, edits))  # noqa: B023 # called at once
        for edits in edited
    )
    return {kind: round(1000 * seconds, 1) for kind, seconds in found.items()}


def main() -> None:
    """Print the figures as JSON."""
    audio = read_audio(Path(sys.argv[1]))
    figures: dict[str, object] = {}
    for seconds in map(float, sys.argv[2:] or ("10", "60")):
        count = round(seconds * audio.rate_hz)
        samples = np.tile(audio.samples, count // len(audio.samples) + 1)[:count]
        before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        figures[f"{seconds:g} s"] = measured(Audio(samples, audio.rate_hz))
        figures[f"{seconds:g} s, MB more at most"] = (
            resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb
        ) // 1024
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
