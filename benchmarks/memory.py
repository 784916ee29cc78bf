"""Memory for an hour of speech: reading the recording, and computing its features.

    python benchmarks/memory.py [--minutes 60] [--suffix wav|flac|mp3|m4a|opus]

Prints one JSON object per step. ``traced`` is the peak of allocations by Python and NumPy (tracemalloc), ``process``
the growth of the largest resident size of the process.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np

from lipmotion.speech.features.mfcc import mfcc
from lipmotion.speech.sound.audio_files import read_audio

CODECS = {"wav": "pcm_s16le", "flac": "flac", "mp3": "libmp3lame", "m4a": "aac", "opus": "libopus"}
RATE_HZ = 48_000


def main() -> None:
    """Print the memory of reading and of the features."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=int, default=60)
    parser.add_argument("--suffix", choices=CODECS, default="wav")
    parser.add_argument("--untraced", action="store_true", help="without tracemalloc, which costs memory itself")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"speech.{options.suffix}"
        write(path, CODECS[options.suffix], options.minutes)
        read_audio(write(Path(folder) / f"short.{options.suffix}", CODECS[options.suffix], 1))  # modules are loaded
        audio = measured("read_audio", lambda: read_audio(path), lambda result: result.samples.nbytes, options.untraced)
    measured("mfcc", lambda: mfcc(audio), lambda result: result.values.nbytes, options.untraced)


def write(path: Path, codec: str, minutes: int) -> Path:
    """Write stereo noise, a second at a time; return the path."""
    draw = np.random.default_rng(0)
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=RATE_HZ, layout="stereo")
        size = stream.codec_context.frame_size or None
        resampler = av.AudioResampler(format=stream.format.name, rate=RATE_HZ, layout="stereo", frame_size=size)
        for second in range(60 * minutes):
            noise = draw.normal(0, 0.1, (2, RATE_HZ)).astype(np.float32)
            frame = av.AudioFrame.from_ndarray(noise, format="fltp", layout="stereo")
            frame.rate, frame.pts = RATE_HZ, second * RATE_HZ
            for part in resampler.resample(frame):
                container.mux(stream.encode(part))
        for part in resampler.resample(None):
            container.mux(stream.encode(part))
        container.mux(stream.encode())
    return path


def measured(step: str, run: Callable[[], Any], size: Callable[[Any], int], untraced: bool) -> Any:
    """Run a step, print its memory, return its result."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if not untraced:
        tracemalloc.start()
    result = run()
    figures = {"step": step, "result_mb": megabytes(size(result))}
    if not untraced:
        figures["traced_mb"] = megabytes(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(json.dumps(figures | {"process_mb": megabytes(1024 * grown)}))
    return result


def megabytes(count: float) -> float:
    """Return a number of bytes in units of 10⁶ bytes."""
    return round(count / 1e6, 1)


if __name__ == "__main__":
    main()
