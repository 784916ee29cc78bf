"""Speed and memory of realistic video: the whole ``animate --face``, and the stitching alone beside OpenCV's.

    python benchmarks/render_video.py FOLDER --model FILE.lipmotion [--work FOLDER] [--clips 20] [--seconds 12,60]
        [--sizes 360x288,1280x720] [--rounds 3] [--only build|animate|stitch]

FOLDER holds clips of one speaker, with sound. For every size they are enlarged (cubic, edges repeated at the sides), a
face is built from the first --clips of them, and their sound, one after the other, is animated on the first. Prints
JSON objects:

build   : wall and processor seconds, peak memory of the process, bytes of the face
animate : whole processes, for every length: wall and processor seconds, peak memory; medians of the rounds, ways taken
          in turn. Then frames a second, and a processor second, of the additional frames of the longest over the
          shortest: without start-up. ``pictures`` leaves out the time that the same speech takes to a .json. On a
          machine with other work the processor seconds are what counts
stitch  : milliseconds a frame, one thread, the least of the rounds (kernels are compiled during the first ones): cut a
          patch, clone it, place it; cloning alone; and ``cv2.seamlessClone`` of the same patch
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
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from lipmotion.formats.sound import write_sound
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio
from lipmotion_faces.appearance.lower_face import FaceShape, best_scale, region_map, replaced_part
from lipmotion_faces.appearance.placing import cut, feather, place
from lipmotion_faces.appearance.poisson import CloningSystem, cloning_system
from lipmotion_faces.tracking.footage import footage_frames, track_footage
from lipmotion_faces.tracking.frames import open_video

COMMAND = [sys.executable, "-m", "lipmotion.cli.main"]
Pictures = NDArray[np.uint8]
RATE_HZ = 25
STITCHED_FRAMES = 9
"""Rounds of stitching."""
BATCH = 25
"""Frames that are stitched at once."""
SHAPE = FaceShape(half_width_px=48.0, bottom_px=142.0)
"""Of the lower face that is replaced: that of GRID s1."""


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--work", type=Path, help="where enlarged clips and faces are kept; default: nowhere")
    parser.add_argument("--clips", type=int, default=20)
    parser.add_argument("--seconds", default="12,60")
    parser.add_argument("--sizes", default="360x288,1280x720")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", action="append", choices=("build", "animate", "stitch"))
    options = parser.parse_args()
    clips = sorted(path for path in options.folder.iterdir() if path.is_file())[: options.clips]
    lengths = [int(value) for value in options.seconds.split(",")]
    only = options.only or ("build", "animate", "stitch")
    with tempfile.TemporaryDirectory() as temporary:
        work = options.work or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        speech = [spoken(clips, length, work / f"speech-{length}.wav") for length in lengths]
        for size in options.sizes.split(","):
            width, height = map(int, size.split("x"))
            enlarged = [resized(clip, work / size / f"{clip.stem}.mp4", width, height) for clip in clips]
            face = work / f"{size}.face"
            if "build" in only or ("animate" in only and not face.exists()):
                build(size, enlarged[0].parent, face)
            if "animate" in only:
                animate(size, speech, lengths, options.model, face, enlarged[0], options.rounds)
            if "stitch" in only:
                stitch(size, enlarged[0])


def show(figure: str, **values: Any) -> None:
    """Print one figure."""
    print(json.dumps({"figure": figure, **values}), flush=True)


def run(arguments: list[str]) -> tuple[float, float, float]:
    """Run ``lipmotion``; return wall seconds, processor seconds, and the largest resident size of the process, MB."""
    start = time.perf_counter()
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.DEVNULL, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            errors.seek(0)
            sys.exit(f"lipmotion {' '.join(arguments)}\n{errors.read().decode()}")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def build(size: str, footage: Path, face: Path) -> None:
    """Build a face from a folder of clips."""
    wall_s, cpu_s, memory_mb = run(["face", "build", str(footage), "-o", str(face)])
    values = {"wall_s": round(wall_s, 1), "cpu_s": round(cpu_s, 1), "memory_mb": round(memory_mb)}
    show(f"build {size}", **values, bytes=face.stat().st_size)


def animate(
    size: str, speech: list[Path], lengths: list[int], model: Path, face: Path, background: Path, rounds: int
) -> None:
    """Time ``animate`` for every length of speech."""
    with tempfile.TemporaryDirectory() as folder:
        video, motion = Path(folder) / "video.mp4", Path(folder) / "motion.json"
        pictures = ["--face", str(face), "--background", str(background)]
        results: dict[tuple[int, str], list[tuple[float, float, float]]] = {}
        for _ in range(rounds):
            for length, path in zip(lengths, speech, strict=True):
                spoken_by = ["animate", str(path), "--model", str(model)]
                results.setdefault((length, "mp4"), []).append(run([*spoken_by, *pictures, "-o", str(video)]))
                results.setdefault((length, "json"), []).append(run([*spoken_by, "-o", str(motion)]))
    middle = {
        key: tuple(statistics.median(column) for column in zip(*rows, strict=True)) for key, rows in results.items()
    }
    for length in lengths:
        wall_s, cpu_s, memory_mb = middle[length, "mp4"]
        values = {"wall_s": round(wall_s, 2), "cpu_s": round(cpu_s, 2), "memory_mb": round(memory_mb)}
        show(f"animate {size}, {length} s", **values, motion_alone_s=round(middle[length, "json"][0], 2))
    if len(lengths) > 1:
        frames = (lengths[-1] - lengths[0]) * RATE_HZ
        for clock, column in (("second", 0), ("CPU second", 1)):
            whole_s, motion_s = (
                middle[lengths[-1], kind][column] - middle[lengths[0], kind][column] for kind in ("mp4", "json")
            )
            rates = {"all": round(frames / whole_s, 1), "pictures": round(frames / (whole_s - motion_s), 1)}
            show(f"animate {size}, frames a {clock} after the first {lengths[0]} s", **rates)


def stitch(size: str, path: Path) -> None:
    """Time the stitching of one clip: its own patches put back, and OpenCV's way to do the same."""
    cv2.setNumThreads(1)
    footage = track_footage(path)
    frames = list(footage_frames(footage))
    scale = best_scale(footage.face_to_image)
    to_frame = region_map(footage.face_to_image, scale)
    mask = replaced_part(SHAPE, scale)
    shape = mask.shape
    system, weight = cloning_system(mask), feather(mask, 6.0 * scale)
    ours, opencv, cloned = [], [], []
    for _ in range(STITCHED_FRAMES):
        starts = range(0, len(frames), BATCH)
        parts = [stitched(frames[n : n + BATCH], to_frame[n : n + BATCH], system, weight) for n in starts]
        cut, clone, placed, theirs = 1e3 * np.sum(parts, axis=0) / len(frames)
        ours.append(cut + clone + placed)
        cloned.append(clone)
        opencv.append(theirs)
    times = {"cut_clone_place_ms": min(ours), "clone_ms": min(cloned), "seamlessClone_ms": min(opencv)}
    ratios = {"ratio_of_cloning": min(opencv) / min(cloned), "ratio_of_all": min(opencv) / min(ours)}
    rounded = {name: round(float(value), 3) for name, value in (times | ratios).items()}
    show(f"stitch {size}", patch=f"{shape[1]}x{shape[0]}", frames=len(frames), **rounded)


def stitched(
    frames: list[Pictures], to_frame: NDArray[np.float64], system: CloningSystem, weight: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return processor seconds of cutting, cloning, placing, and of ``cv2.seamlessClone`` of the same patches."""
    shape = (weight.shape[0], weight.shape[1])
    copies = [frame.copy() for frame in frames]
    marks = [time.process_time()]
    pairs = zip(frames, to_frame, strict=True)
    patches = np.stack([cut(image, one, shape) for image, one in pairs])
    backgrounds = np.clip(np.rint(patches), 0, 255).astype(np.uint8)
    marks.append(time.process_time())
    faces = np.roll(backgrounds, 1, axis=0)
    clones = system.clone(faces, backgrounds)
    marks.append(time.process_time())
    for frame, clone, one in zip(copies, clones, to_frame, strict=True):
        place(frame, clone, weight, one)
    marks.append(time.process_time())
    whole = system.mask.astype(np.uint8) * 255
    centre = (shape[1] // 2 + 20, shape[0] // 2 + 20)
    framed = np.pad(backgrounds, ((0, 0), (20, 20), (20, 20), (0, 0)))
    for face, background in zip(faces, framed, strict=True):
        cv2.seamlessClone(face, background, whole, centre, cv2.NORMAL_CLONE)
    marks.append(time.process_time())
    return np.diff(marks)


def spoken(clips: list[Path], seconds: int, path: Path) -> Path:
    """Write the sound of clips, one after the other, for a number of seconds; return the path."""
    if path.exists():
        return path
    parts, count = [], 0
    while count < seconds * 16_000:
        for clip in clips:
            parts.append(read_audio(clip).samples)
            count += len(parts[-1])
    write_sound(path, Audio(np.concatenate(parts)[: seconds * 16_000], 16_000))
    return path


def resized(clip: Path, path: Path, width: int, height: int) -> Path:
    """Write a clip with its sound at another size, edges repeated at the sides; return the path."""
    if path.exists():
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    audio = read_audio(clip)
    with open_video(clip) as video:
        frames = [frame.image for frame in video.frames]
    scale = min(width / frames[0].shape[1], height / frames[0].shape[0])
    part = (round(frames[0].shape[1] * scale), round(frames[0].shape[0] * scale))
    left, top = (width - part[0]) // 2, (height - part[1]) // 2
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=Fraction(RATE_HZ), options={"crf": "12", "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        sound: Any = container.add_stream("aac", rate=16_000, layout="mono")
        for image in frames:
            large = cv2.resize(image, part, interpolation=cv2.INTER_CUBIC) if scale != 1 else image
            sides = (top, height - part[1] - top, left, width - part[0] - left)
            shown = cv2.copyMakeBorder(large, *sides, cv2.BORDER_REPLICATE)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(shown, format="rgb24")))
        container.mux(stream.encode(None))
        samples = np.ascontiguousarray(audio.samples[None], np.float32)
        sound_frame = av.AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
        sound_frame.rate, sound_frame.pts, sound_frame.time_base = 16_000, 0, Fraction(1, 16_000)
        fifo = av.AudioFifo()
        fifo.write(sound_frame)
        while (block := fifo.read(1024, partial=True)) is not None:
            container.mux(sound.encode(block))
        container.mux(sound.encode(None))
    return path


if __name__ == "__main__":
    main()
