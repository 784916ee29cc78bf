"""Speed of videos of drawn characters: whole processes, the parts of a frame, and whether pictures stay the same.

    python benchmarks/drawn_video.py SPEECH [--before TREE] [--face woman] [--rounds 3] [--only whole|frame|likeness]

SPEECH is a recording, TREE another version of this repository (``git worktree add TREE COMMIT``). Prints JSON objects:

whole    : ``lipmotion animate SPEECH`` to .mp4 and to .json, with every way of recognition: wall and processor seconds
           and peak memory of the process, medians of the rounds; versions and ways are taken in turn. On a machine with
           other work the processor seconds are what counts; ``load`` says how much other work there was
frame    : milliseconds of processor time a frame, one thread that draws: drawing, and encoding what was drawn
likeness : pictures for the encoder beside those for people, converted by FFmpeg: PSNR of brightness and colours, of
           every seventh frame, and the largest difference
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion.pipeline.request import Request
from lipmotion.speech.features.prosody import prosody_of
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Generation
from lipmotion_faces.base import DrawsPlanes, Face, Staging
from lipmotion_faces.outputs.drawn_video import load_drawing
from lipmotion_faces.registry import staged_face
from lipmotion_faces.video.mp4 import write_mp4

HERE = Path(__file__).parents[1]
FACES = ("woman", "man", "cartoon")
RECOGNISERS = ("fast", "auto")
CHECKED_STEP = 7
CHECKED_FRAMES = 400
"""Frames whose encoding is timed; they are held in memory."""
Bytes = NDArray[np.uint8]


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", type=Path)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--face", default="woman")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", choices=("whole", "frame", "likeness"))
    options = parser.parse_args()
    chosen = (options.only,) if options.only else ("whole", "frame", "likeness")
    if "whole" in chosen:
        for figure in whole_processes(options):
            print(json.dumps(figure), flush=True)
    if {"frame", "likeness"} & {*chosen}:
        generation = lipmotion.animate(Request(options.speech, recogniser="fast"))
        if "frame" in chosen:
            print(json.dumps({"frame": options.face, **frame_times(options, generation)}), flush=True)
        if "likeness" in chosen:
            for face in FACES:
                print(json.dumps({"likeness": face, **likeness(face, options.speech, generation)}), flush=True)


def whole_processes(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the medians of whole processes."""
    trees = {"now": HERE} | ({"before": options.before.resolve()} if options.before else {})
    ways = list(product(trees, RECOGNISERS, (".mp4", ".json")))
    runs: dict[tuple[str, ...], list[tuple[float, ...]]] = {way: [] for way in ways}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.rounds + 1):
            for way in ways:
                tree, recogniser, suffix = way
                command = ["animate", str(options.speech.resolve()), "-o", str(Path(folder) / f"a{suffix}")]
                command += ["--face", options.face, "--recogniser", recogniser]
                found = _run(trees[tree], command, folder)
                if number:  # the first one compiles kernels
                    runs[way].append(found)
    for way, found_runs in runs.items():
        wall, processor, peak, load = (statistics.median(column) for column in zip(*found_runs, strict=True))
        times = {"wall_s": round(wall, 2), "processor_s": round(processor, 2), "peak_MB": round(peak)}
        yield {"whole": " ".join(way), **times, "load": round(load, 1)}


def _run(tree: Path, command: list[str], folder: str) -> tuple[float, float, float, float]:
    """Return wall and processor seconds, and peak memory in MB, of a process and its own; the load before it."""
    load, start_s = os.getloadavg()[0], time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "lipmotion.cli.main", *command],
        env={**os.environ, "PYTHONPATH": str(tree / "src")},
        cwd=folder,
        stdout=subprocess.DEVNULL,
    )
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"lipmotion {' '.join(command)} failed")
    return time.perf_counter() - start_s, used.ru_utime + used.ru_stime, used.ru_maxrss / 1000, load


def frame_times(options: argparse.Namespace, generation: Generation) -> dict[str, float]:
    """Return milliseconds of processor time a frame, of drawing and of encoding."""
    face = drawn_face(options.face, options.speech)
    assert isinstance(face, DrawsPlanes)
    load_drawing(staged_face(options.face, Staging()))
    planes = face.render_planes(generation.motion, generation.units)
    assert planes is not None
    next(planes)
    kept, count, start_s = list[Bytes](), 0, time.process_time()
    for frame in planes:
        count += 1
        if len(kept) < CHECKED_FRAMES:
            kept.append(frame)
    drawn_s = (time.process_time() - start_s) / count
    with tempfile.TemporaryDirectory() as folder:
        start_s = time.process_time()
        write_mp4(Path(folder) / "a.mp4", kept, fps=25, audio=Audio(np.zeros(len(kept) * 1920, np.float32), 48_000))
        encoded_s = (time.process_time() - start_s) / len(kept)
    return {"drawing_ms": round(drawn_s * 1e3, 2), "encoding_ms": round(encoded_s * 1e3, 2)}


def drawn_face(name: str, speech: Path) -> Face:
    """Return a face that moves with a recording."""
    return staged_face(name, Staging(), prosody_of(read_audio(speech)))


def likeness(name: str, speech: Path, generation: Generation) -> dict[str, float]:
    """Return PSNR in dB of brightness and colours, means and least, and the largest difference."""
    face = drawn_face(name, speech)
    assert isinstance(face, DrawsPlanes)
    pictures, planes = (
        face.render(generation.motion, generation.units),
        face.render_planes(generation.motion, generation.units),
    )
    assert planes is not None
    luma, colours, largest = [], [], 0
    for number, (picture, frame) in enumerate(zip(pictures, planes, strict=True)):
        if number % CHECKED_STEP == 0:
            given = av.VideoFrame.from_ndarray(picture).reformat(format="yuv420p", dst_colorspace="itu601").to_ndarray()
            difference = given.astype(np.int16) - frame
            luma.append(_decibel(difference[: len(picture)]))
            colours.append(_decibel(difference[len(picture) :]))
            largest = max(largest, int(np.abs(difference).max()))
    return {
        "brightness_dB": round(statistics.mean(luma), 1),
        "least": round(min(luma), 1),
        "colours_dB": round(statistics.mean(colours), 1),
        "least_colours": round(min(colours), 1),
        "largest": largest,
    }


def _decibel(difference: NDArray[np.int16]) -> float:
    return float(10 * np.log10(255**2 / np.mean(np.square(difference.astype(np.float64)))))


if __name__ == "__main__":
    main()
