"""What comes back of motion and labels that were written and read again: the largest error of every importable format;
of motion that is generated again from its own phones, unedited and edited; and of edited values.

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
from lipmotion.pipeline.outputs.curve_sets import curves_of
from lipmotion.pipeline.outputs.motion_files import in_format
from lipmotion.pipeline.outputs.motion_input import read_generation
from lipmotion.pipeline.understand.read_request import read_units
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.noise import noisy_audio
from lipmotion.types import Audio, Generation, Motion, Timeline
from lipmotion.units import is_silent

TEXT = "Please bring my mother the blue ball. Bob bought a big apple pie."
LONG_S = 90.0
NTSC_HZ = 30_000 / 1001


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


def again(first: Motion, second: Motion) -> str:
    """Return how far motion that was generated again is from the first, as text."""
    error = float(np.abs(first.values - second.values).max())
    return "the same bits" if error == 0 else f"{error:.1e} eye distances"


def print_generated_again(folder: Path, speech: Path, transcript: Path) -> None:
    """Print, for several kinds of speech, what the phones of three files give when they are given back unedited."""
    audio = read_audio(speech)
    repeated = Audio(np.resize(audio.samples, round(LONG_S * audio.rate_hz)), audio.rate_hz)
    requests = {
        "transcript": lipmotion.Request(audio, transcript=transcript),
        "recognised (auto)": lipmotion.Request(audio),
        "recognised (fast)": lipmotion.Request(audio, recogniser="fast"),
        "white noise of 15 dB": lipmotion.Request(noisy_audio(audio, "white", 15.0)),
        f"{LONG_S:.0f} s, recognised (fast)": lipmotion.Request(repeated, recogniser="fast"),
    }
    kinds = {name: (request.recording, lipmotion.animate(request)) for name, request in requests.items()}
    sound, said = lipmotion.speak(TEXT)
    lipmotion.write(said, folder / "said.wav", speech=sound)
    kinds["speak"] = (folder / "said.wav", said)
    for name, (recording, result) in kinds.items():
        found = []
        for suffix in ("TextGrid", "json", "npz"):
            lipmotion.write(result, folder / f"b.{suffix}")
            request = lipmotion.Request(recording, units=read_units(folder / f"b.{suffix}"))
            found.append(again(result.motion, lipmotion.animate(request).motion))
        print(f"| {name} | {' | '.join(found)} |")


def print_moved_boundary(folder: Path, speech: Path) -> None:
    """Print how far a boundary that is moved by 30 ms in a TextGrid changes the motion."""
    result = lipmotion.animate(lipmotion.Request(speech, recogniser="fast"))
    lipmotion.write(result, folder / "c.TextGrid")
    units = list(read_units(folder / "c.TextGrid"))
    loud = [not is_silent(span.label.phone) for span in units]
    at = next(n for n in range(len(units) // 2, len(units) - 1) if loud[n] and loud[n + 1])
    moved_s = units[at].end_s + 0.03
    text = (folder / "c.TextGrid").read_text(encoding="utf-8")
    phones, mark, rest = text.partition('name = "words"')
    edited = phones.replace(f"= {units[at].end_s:.9g}\n", f"= {moved_s}\n")
    (folder / "c.TextGrid").write_text(edited + mark + rest, encoding="utf-8")
    given = read_units(folder / "c.TextGrid")
    assert sum(a.end_s != b.end_s for a, b in zip(Timeline(tuple(units)), given, strict=True)) == 1
    other = lipmotion.animate(lipmotion.Request(speech, units=given)).motion
    away_s = np.abs(result.motion.time_s - moved_s)
    error = np.abs(other.values - result.motion.values).max(axis=1)
    near, far = error[away_s < 0.2].max(), error[away_s > 1].max()
    print(f"| boundary moved by 30 ms | {near:.1e} eye distances beside it | {far:.1e} further than 1 s |")


def print_written_twice(folder: Path, result: Generation, speech: Path) -> None:
    """Print what changes in motion that is read and written again, and in one whose first value is edited."""
    for suffix in ("json", "csv", "npz", "c3d", "fap", "livelink.csv"):
        for hertz in (None, 25.0, NTSC_HZ):
            paths = [folder / f"{name}.{suffix}" for name in "def"]
            lipmotion.write(result, paths[0], rate_hz=hertz, speech=speech)
            given = read_generation(paths[0])
            lipmotion.write(given, paths[1])
            (first, phones), (second, kept) = read_motion(paths[0]), read_motion(paths[1])
            same = first.channels == second.channels and np.array_equal(first.values, second.values) and phones == kept
            wanted = hertz or (60.0 if suffix == "livelink.csv" else 100.0)
            rates = f"{wanted:.9g}, {first.rate_hz:.9g}, {second.rate_hz:.9g} Hz"
            values = given.motion.values.copy()
            values[len(values) // 2, 0] += 0.125 if suffix != "fap" else 100
            lipmotion.write(replace(given, motion=replace(given.motion, values=values)), paths[2])
            edited = read_motion(paths[2])[0].values
            changed = int((edited != second.values).sum()) if len(edited) == len(first.values) else -1
            print(f"| `.{suffix}` | {rates} | {'the same' if same else 'other'} | {changed} |")


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
        print_written_twice(folder, result, speech)
        print_generated_again(folder, speech, transcript)
        print_moved_boundary(folder, speech)


if __name__ == "__main__":
    main()
