"""What comes back of motion and labels that were written and read again: the largest error of every importable format.

python benchmarks/round_trips.py examples/welcome.flac examples/welcome.txt
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import lipmotion
from lipmotion.corpora.labels import read_labels, read_phones
from lipmotion.export import read_motion, write_motion
from lipmotion.pipeline.characters import curves_of
from lipmotion.pipeline.motion_files import in_format
from lipmotion.types import Generation, Motion


def off(written: Motion, path: Path) -> str:
    """Return the largest error of a file, per unit, as text."""
    found = read_motion(path)[0]
    assert set(found.names) >= set(written.names), set(written.names) - set(found.names)
    worst: dict[str, float] = {}
    for channel in written.channels:
        error = float(np.abs(found[channel.name][: len(written.values)] - written[channel.name]).max())
        worst[channel.unit] = max(worst.get(channel.unit, 0.0), error)
    errors = ", ".join(f"{error:.1e} {unit}" for unit, error in worst.items())
    return f"{len(written.names)} channels, {len(written.values)} frames at {found.rate_hz:g} Hz | {errors}"


def main() -> None:
    """Write every format, read it, print a row of a table."""
    speech, transcript = map(Path, sys.argv[1:3])
    result: Generation = lipmotion.animate(speech, transcript=transcript)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for suffix in ("json", "csv", "npz", "c3d", "fap"):
            path = folder / f"a.{suffix}"
            lipmotion.write(result, path, speech=speech)
            print(f"| `.{suffix}` | {off(in_format(path, result, result, None).motion, path)} |")
        weights = curves_of(result.motion, result.units, "arkit").resampled(60.0)
        path = folder / "a.livelink.csv"
        write_motion(path, replace(result, motion=weights, spread=weights.values), source={}, model={})
        print(f"| `.livelink.csv` | {off(weights, path)} |")
        lipmotion.write(result, [folder / "a.TextGrid", folder / "a.vtt"])
        phones = read_phones(folder / "a.TextGrid")
        times = [(a.start_s - b.start_s, a.end_s - b.end_s) for a, b in zip(phones, result.units, strict=True)]
        print(f"| `.TextGrid` | {len(phones)} phones | {np.abs(times).max():.1e} s |")
        transcript_read = read_labels(folder / "a.vtt").transcript
        assert transcript_read is not None
        said = {(s.label.word) for s in result.units if s.label.word}
        starts = {span.start_s for span in result.units}
        late = [min(abs(line.start_s - start_s) for start_s in starts) for line in transcript_read.lines]
        assert set(transcript_read.words) <= said
        print(f"| `.vtt` | {len(transcript_read.words)} words | {max(late):.1e} s |")


if __name__ == "__main__":
    main()
