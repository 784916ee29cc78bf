"""Design of a study: from conditions and sentences, with their sources, to a folder that raters can be shown."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import find_version
from lipmotion.formats.base import list_read_suffixes
from lipmotion.pipeline.job import Job, run
from lipmotion.pipeline.model import find_shipped, load_model
from lipmotion.pipeline.outputs.motion_files import match_duration, read_generation
from lipmotion.pipeline.outputs.output import write
from lipmotion.pipeline.request import Outputs, Request
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.storage.files import replace_folder
from lipmotion.storage.sources import (
    VIDEO_SUFFIXES,
    check_listable,
    has_video,
    hash_file,
    is_recording,
    open_media,
    read_text_file,
)
from lipmotion.types import Audio, Monitor, silent_monitor
from lipmotion.types.progress import with_progress
from lipmotion_faces.tracking.track import read_video_frames
from lipmotion_faces.video.mp4 import SOUND_HZ, write_mp4
from lipmotion_faces.video.synthetic_mark import LABEL, SOURCE_TYPE, mark_metadata
from lipmotion_studio.study import manifest
from lipmotion_studio.study.answers import ANCHOR, KINDS, MOS, PAIRED, RECORDING
from lipmotion_studio.study.settings import CONSENT, INSTRUCTIONS, StudySettings

MODEL_SUFFIX, JOB_SUFFIX = ".lipmotion", ".toml"
SHIPPED = "shipped"


Condition = Callable[[Path, Path], tuple[Path, dict[str, str]]]
"""Returns the video of a sentence, given by its recording, which is the sound of all videos that are drawn; where it
has to be made, it is the file of the second path. And how it was made, in texts by name."""


def read_sentences(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings of sentences in files and folders. Raises InputError: none, or two of one name."""
    sentences: list[Path] = []
    for path in paths:
        if path.is_dir():
            check_listable(path)
        sentences += sorted(filter(is_recording, path.iterdir())) if path.is_dir() else [path]
    if not sentences:
        raise InputError("no sentences; give recordings: --sentence FILE|FOLDER")
    names = [path.stem for path in sentences]
    for path in sentences:
        if names.count(path.stem) > 1:
            raise InputError(f"{path}: two sentences are called {path.stem!r}; rename one file")
        if not path.is_file():
            raise InputError(f"{path}: no such file; give the recording of a sentence")
    return sentences


def parse_conditions(texts: Sequence[str]) -> dict[str, str]:
    """Return the sources of conditions by name. Raises InputError: another form, a name that is taken, or under two."""
    sources: dict[str, str] = {}
    for text in texts:
        name, equals, source = text.partition("=")
        name, source = name.strip(), source.strip()
        if text.strip() == RECORDING:
            source = RECORDING
        elif not (name and equals and source):
            raise InputError(f"the condition {text!r}, required NAME=SOURCE, or {RECORDING}")
        elif name in (ANCHOR, RECORDING) or source == RECORDING:
            raise InputError(f"the condition {text!r}: the recordings themselves are called {RECORDING!r}, no other")
        if name in sources:
            raise InputError(f"two conditions are called {name!r}; give them different names")
        sources[name] = source
    if len(sources) < 2:
        raise InputError(f"{len(sources)} condition, required at least 2: --condition NAME=SOURCE, or {RECORDING}")
    return sources


def make_condition(source: str, sentences: Sequence[Path], drawn: Job) -> Condition:
    """Return what gives the videos of a condition.

    source : ``recording``; a model, ``shipped`` or a file; a job file; or a folder with a video or a motion file of
             each sentence, of its name
    Raises InputError: no such source, or it lacks a sentence.
    """
    path = Path(source)
    if source == RECORDING:
        for recording in sentences:
            if not has_video(recording):
                raise InputError(
                    f"{recording}: has no pictures, so the recording cannot be shown; give videos as sentences, or "
                    f"leave the condition {RECORDING} out"
                )
        return lambda recording, _: (recording, {"made": "recording"})
    if path.is_dir():
        return _collect_finished(path, sentences, drawn)
    if source != SHIPPED and not path.is_file():
        raise InputError(f"{source}: no such model, job file or folder; give one, or {SHIPPED!r}: the model that ships")
    if path.suffix.lower() == JOB_SUFFIX:
        job = Job.from_file(path)
        return _animate_sentences(job, {"job": str(path), "job_sha256": hash_file(path)})
    if source != SHIPPED and path.suffix.lower() != MODEL_SUFFIX:
        raise InputError(f"{source}: required a model ({MODEL_SUFFIX}), a job file ({JOB_SUFFIX}) or a folder")
    model = None if source == SHIPPED else path
    return _animate_sentences(replace(drawn, request=replace(drawn.request, model=model)), {})


def _collect_finished(folder: Path, sentences: Sequence[Path], drawn: Job) -> Condition:
    """Return a condition of finished videos or of motion to draw. Raises InputError: none or several of a sentence."""
    files: dict[str, Path] = {}
    for name in (recording.stem for recording in sentences):
        there = [path for path in sorted(folder.iterdir()) if path.is_file() and path.stem == name]
        for suffixes in (VIDEO_SUFFIXES, list_read_suffixes()):
            fitting = [path for path in there if path.suffix.lower() in suffixes]
            if len(fitting) > 1:
                raise InputError(f"{fitting[0]} and {fitting[1]}: both are of the sentence {name!r}; move one away")
            if fitting:
                files[name] = fitting[0]
                break
        else:
            way_out = f"add {name}.mp4 or {name}.json"
            raise InputError(f"{folder}: has no video and no motion of the sentence {name!r}; {way_out}")

    def condition(recording: Path, target: Path) -> tuple[Path, dict[str, str]]:
        path, outputs = files[recording.stem], drawn.outputs
        made = {"file": path.name, "file_sha256": hash_file(path)}
        if path.suffix.lower() in VIDEO_SUFFIXES:
            return path, made | {"made": "finished"}
        generation = match_duration(read_generation(path), read_audio(recording, warn=False).duration_s)
        write(generation, target, speech=recording, face=outputs.face, fps=outputs.fps)
        return target, made | {"made": "drawn", "face": outputs.face}

    return condition


def _animate_sentences(job: Job, made: dict[str, str]) -> Condition:
    """Return a condition whose videos are animated from the sound of the sentences."""
    model_path = job.request.model or find_shipped()
    made = made | {"made": "animated", "model": model_path.name, "model_sha256": hash_file(model_path)}
    made |= {"face": job.outputs.face}

    load = cache(load_model)

    def condition(recording: Path, target: Path) -> tuple[Path, dict[str, str]]:
        run(job.of(recording, (str(target),)), model=load(job.request.model), words_beside=True)
        return target, made

    return condition


def encode_rated_video(source: Path, target: Path, sound: Path, late_ms: float = 0.0) -> float:
    """Write a video as raters see it (H.264, AAC), and return how long it lasts, in seconds.

    sound   : the recording whose sound a video without sound gets
    late_ms : how much later than it was the sound comes; the video keeps its length
    The mark of a synthetic video stays: raters do not see it, whoever gets the file can.
    Raises InputError: it cannot be read, or is too short to be late. Raises ExportError: it cannot be written.
    """
    frames, rate_hz = read_video_frames(source)
    with open_media(source) as container:
        has_sound, texts = bool(container.streams.audio), list(container.metadata.values())
    played = read_audio(source if has_sound else sound, SOUND_HZ, warn=False)
    shift, count = round(late_ms / 1000 * played.rate_hz), len(played.samples)
    if not 0 <= shift < count:
        raise InputError(f"the sound of {played.duration_s:.2f} s cannot be {late_ms:g} ms late; give longer sentences")
    late = Audio(np.concatenate([np.zeros(shift, np.float32), played.samples[: count - shift]]), played.rate_hz)
    is_marked = any(SOURCE_TYPE in text or text.startswith(LABEL) for text in texts)
    mark = mark_metadata() if is_marked else None
    marked: dict[str, Any] = {"tags": mark.tags, "xmp": mark.xmp} if mark else {}
    counter = itertools.count()
    even = (frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2] for frame, _ in zip(frames, counter, strict=False))
    write_mp4(target, even, fps=rate_hz, audio=late, **marked)
    return max(next(counter) / rate_hz, played.duration_s)


MAX_TEXT_BYTES = 1 << 16
DEFAULTS = StudySettings()


def design_study(
    output: Path,
    kind: str,
    conditions: Sequence[str],
    sentences: Sequence[Path],
    settings: StudySettings = DEFAULTS,
    monitor: Monitor = silent_monitor,
) -> manifest.Study:
    """Make a study: render, encode and name its videos, plan its trials, and write its folder.

    output     : a folder that must not exist
    kind       : ``paired`` or ``mos``
    conditions : texts ``NAME=SOURCE``; the source is a model, a job file, or a folder with a finished video or a motion
                 file for each sentence; ``recording`` alone: the videos of the sentences themselves
    sentences  : recordings, or folders of them, named as the sentences
    The anchor is the recording, or else the first condition, with its sound late.
    Raises InputError: not such conditions or sentences, or what reading and animating them raises.
    Raises ExportError: the folder exists, or cannot be written.
    """
    if kind not in KINDS:
        raise InputError(f"a study of the kind {kind!r}, required one of {', '.join(KINDS)}")
    if output.exists():
        raise ExportError(f"{output}: exists; give the name of a new folder")
    sources, spoken = parse_conditions(conditions), read_sentences(sentences)
    drawn = Job(Request(recogniser=settings.recogniser), Outputs(face=settings.face, fps=settings.fps))
    makers = {name: make_condition(source, spoken, drawn) for name, source in sources.items()}
    base = RECORDING if RECORDING in sources else next(iter(sources))
    names, seed = [recording.stem for recording in spoken], settings.seed
    late = manifest.shuffle(names, "anchor", seed)[: settings.anchors]  # the sentences that have an anchor
    texts = {"consent": CONSENT, "instructions": INSTRUCTIONS[kind]}
    for name in texts:
        path = getattr(settings, name)
        if path:
            texts[name] = read_text_file(path, name, MAX_TEXT_BYTES).strip()
    with replace_folder(output) as folder:
        (folder / manifest.VIDEOS).mkdir()
        videos: list[manifest.StudyVideo] = []
        for recording, name in with_progress([*itertools.product(spoken, makers)], "making videos", monitor):
            video, made = makers[name](recording, folder / "made.mp4")
            is_anchor = name == base and recording.stem in late
            for shown_as in (name, ANCHOR) if is_anchor else (name,):  # named by their content
                late_ms, file = settings.anchor_ms if shown_as == ANCHOR else 0.0, folder / manifest.VIDEOS / "made.mp4"
                seconds = encode_rated_video(video, file, recording, late_ms)
                digest = hash_file(file)
                file.replace(file.with_name(f"{digest[:32]}.mp4"))
                about = made | ({"sound_late_ms": f"{late_ms:g}"} if late_ms else {})
                of = (recording.stem, shown_as, round(seconds, 3), digest, about)
                videos.append(manifest.StudyVideo(f"{digest[:32]}.mp4", *of))
            (folder / "made.mp4").unlink(missing_ok=True)
        numbers = {(video.sentence, video.condition): n for n, video in enumerate(videos)}
        trials = manifest.make_main_trials(kind, list(sources), names, numbers)
        with_anchor = [name for name in names if (name, ANCHOR) in numbers]
        anchored = manifest.make_anchor_trials(base, with_anchor, numbers) if kind == PAIRED else []
        checks = manifest.make_attention_trials(kind, trials, settings.checks, seed)
        practice = manifest.make_practice_trials([*trials, *anchored], settings.practice, seed)
        study = manifest.Study(
            kind=kind,
            title=settings.title,
            **texts,
            scales=settings.scales if kind == MOS else (),
            seed=seed,
            conditions=sources | ({ANCHOR: f"{base}, sound {settings.anchor_ms:g} ms late"} if late else {}),
            sentences={path.stem: {"file": path.name, "sha256": hash_file(path)} for path in spoken},
            videos=tuple(videos),
            trials=(*practice, *trials, *anchored, *checks),
            made_by={"lipmotion": find_version()}
            | {name: str(value) for name, value in asdict(settings).items() if name not in texts},
        )
        manifest.write_manifest(study, folder)
    return study
