"""F0 compared with peers: errors and speed where the frequency is known, or agreement on recordings.

    python benchmarks/f0.py [--repeats 5]
    python benchmarks/f0.py RECORDING ...

Peers take part if they can be imported: RAPT (pysptk), DIO and Harvest with StoneMask (pyworld). All search from 60 to
400 Hz, every 10 ms. One JSON object per line. Gross: errors of more than 20 %; fine: mean error of all others; missed:
voiced frames found unvoiced; false: unvoiced frames found voiced. Frames within 25 ms of a change of voicing do not
count.
``factory`` is for a harness that hands over ``cfg`` and has a function ``audio(cfg)``.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

from lipmotion.speech.features.f0 import HIGHEST_HZ, LOWEST_HZ, log_f0
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from testing.formant_synthesiser import PHONE_TARGETS, synthesise

Array = np.ndarray[Any, Any]
Tracker = Callable[[Array], Array]
RATE_HZ = 16_000
LONG_ENOUGH_S = 5
VOWELS = {"a": (730, 1090, 2440), "i": (290, 2200, 2950), "u": (320, 900, 2250)}
NOISES = {"-40 dB": (-40, 0.0), "-10 dB": (-10, 0.0), "-10 dB, pink": (-10, 0.95), "0 dB": (0, 0.0)}


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="*", type=Path)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    tried = trackers()
    if options.recordings:
        agreement(tried, [read_audio(path).samples for path in options.recordings])
        return
    for kind, sounds in {
        "phones": list(sentences()),
        **{f"glides, noise {n}": list(glides(n)) for n in NOISES},
    }.items():
        for name, track in tried.items():
            found = [track(samples) for samples, _ in sounds]
            show(sound=kind, tracker=name, **errors(found, [known for _, known in sounds]))
    minute = np.concatenate([samples for samples, _ in sentences()])[: 60 * RATE_HZ]
    for name, track in tried.items():
        show(tracker=name, audio_s_per_cpu_s=round(60 / cpu_seconds(track, minute, options.repeats)))


def agreement(tried: dict[str, Tracker], recordings: list[Array]) -> None:
    """Print the differences of each pair of trackers."""
    tracks = {name: [track(samples) for samples in recordings] for name, track in tried.items()}
    for first, second in combinations(tracks, 2):
        show(of=first, beside=second, **errors(tracks[first], tracks[second]))


def factory(cfg: Any) -> Callable[[], Array]:
    """Return the work to measure, on the sound of the harness."""
    import __main__

    samples = __main__.audio(cfg).astype(np.float32)
    return lambda: ours(samples)


def ours(samples: Array) -> Array:
    """Return F0 in hertz, 0 where there is no voice."""
    return np.nan_to_num(np.exp(log_f0(Audio(samples, RATE_HZ))))


def trackers() -> dict[str, Tracker]:
    """Return the tracker of this package and those that can be imported."""
    found: dict[str, Tracker] = {"lipmotion": ours}
    try:
        import pysptk

        def rapt(samples: Array) -> Array:  # its frames are centred 5 ms late
            late = np.concatenate([np.zeros(80), samples * 32768.0]).astype(np.float32)
            return pysptk.rapt(late, RATE_HZ, 160, min=LOWEST_HZ, max=HIGHEST_HZ)

        found["RAPT"] = rapt
    except ImportError:
        pass
    try:
        import pyworld

        def refined(search: Callable[..., tuple[Array, Array]]) -> Tracker:
            def track(samples: Array) -> Array:
                x = samples.astype(float)
                hertz, times = search(x, RATE_HZ, f0_floor=LOWEST_HZ, f0_ceil=HIGHEST_HZ, frame_period=10.0)
                return pyworld.stonemask(x, hertz, times, RATE_HZ) * (hertz > 0)

            return track

        found |= {"DIO": refined(pyworld.dio), "Harvest": refined(pyworld.harvest)}
    except ImportError:
        pass
    return found


def errors(tracks: list[Array], references: list[Array]) -> dict[str, float]:
    """Return the errors that the module docstring defines; in references 0 is unvoiced, NaN is not counted."""
    known = np.concatenate(references)
    found = np.concatenate([fitted(f, len(k)) for f, k in zip(tracks, references, strict=True)])
    voiced, both = known > 0, (known > 0) & (found > 0)
    off = np.abs(found[both] / known[both] - 1)
    return {
        "gross %": percent(off > 0.2),
        "fine %": percent(off[off <= 0.2]),
        "missed %": percent(found[voiced] == 0),
        "false %": percent(found[known == 0] > 0),
    }


def percent(values: Array) -> float:
    return round(100 * float(np.mean(values)), 2) if len(values) else 0.0


def fitted(track: Array, frames: int) -> Array:
    return np.pad(track, (0, max(frames - len(track), 0)))[:frames]


def sentences() -> Iterator[tuple[Array, Array]]:
    """Yield sound and F0 of all phones, twice in random order, at eight pitches."""
    names = [name for name in PHONE_TARGETS if name not in ("sil", "sp")]
    for seed, pitch_hz in enumerate((70, 90, 120, 160, 200, 260, 320, 370)):
        random = np.random.default_rng(seed)
        phones = [(str(name), float(random.uniform(0.06, 0.2))) for name in random.permutation(2 * names)]
        audio, spans = synthesise([("sil", 0.3), *phones, ("sil", 0.3)], pitch_hz=pitch_hz, seed=seed)
        known, end_s = np.full(len(audio.samples) // 160 + 1, np.nan), 0.0
        time_s = np.arange(len(known)) / 100
        hertz = pitch_hz * np.interp(time_s * RATE_HZ, [0, len(audio.samples)], [1.06, 0.94])
        for span in spans:
            for part in PHONE_TARGETS[span.label.phone]:
                start_s, end_s = end_s, end_s + part.share * span.duration_s
                inside = (time_s > start_s + 0.025) & (time_s < end_s - 0.025)
                if part.voicing >= 0.3 or part.voicing == 0:
                    known[inside] = hertz[inside] if part.voicing else 0
        yield audio.samples, known


def glides(noise: str) -> Iterator[tuple[Array, Array]]:
    """Yield sound and F0 of glottal pulses through three formants, with noise in pauses."""
    time_s = np.arange(4 * RATE_HZ) / RATE_HZ
    silent = (time_s < 0.3) | (time_s > 3.7) | ((time_s > 1.9) & (time_s < 2.1))
    near = np.convolve(np.abs(np.diff(silent, prepend=True)), np.ones(801), "same") > 0
    curves = (
        70 * 5 ** (time_s / 4),
        380 * (80 / 380) ** (time_s / 4),
        180 * 2 ** (0.3 * np.sin(8 * np.pi * time_s)),
        110 * 2 ** (0.35 * np.sin(6 * np.pi * time_s)),
        65 + 20 * np.sin(2 * np.pi * time_s) ** 2,
    )
    for seed, (vowel, hertz) in enumerate((vowel, hertz) for vowel in VOWELS.values() for hertz in curves):
        phase = np.cumsum(hertz / RATE_HZ) % 1 / 0.6
        samples = lfilter([0.5], [1, -0.5], np.where((phase < 1) & ~silent, phase * (2 - 3 * phase), 0))
        for centre in vowel:
            radius = np.exp(-np.pi * (40 + 0.05 * centre) / RATE_HZ)
            samples = lfilter([1], [1, -2 * radius * np.cos(2 * np.pi * centre / RATE_HZ), radius**2], samples)
        level_db, colour = NOISES[noise]
        hiss = lfilter([1], [1, -colour], np.random.default_rng(seed).normal(size=len(samples)))
        samples = samples / samples[~silent].std() + hiss / hiss.std() * 10 ** (level_db / 20)
        known = np.where(near, np.nan, np.where(silent, 0, hertz))[::160]
        yield (0.1 * samples).astype(np.float32), known


def cpu_seconds(track: Tracker, samples: Array, repeats: int) -> float:
    track(samples)
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        track(samples)
        spent.append(time.process_time() - start)
        if sum(spent) > LONG_ENOUGH_S:
            break
    return float(np.median(spent))


def show(**figures: object) -> None:
    print(json.dumps(figures), flush=True)


if __name__ == "__main__":
    main()
