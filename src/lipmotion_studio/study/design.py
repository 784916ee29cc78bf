"""Design of a study: from conditions and sentences to a folder that raters can be shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import installed_version
from lipmotion.pipeline.job import Job
from lipmotion.pipeline.request import Outputs, Request
from lipmotion.storage.files import atomic_folder, read_text_file, sha256_of
from lipmotion.types import Monitor, silent_monitor
from lipmotion.types.progress import with_progress
from lipmotion_studio.study.answers import ANCHOR, KINDS, MOS, PAIRED, RANKING, RECORDING
from lipmotion_studio.study.manifest import VIDEOS, Study, StudyVideo, write_manifest
from lipmotion_studio.study.settings import CONSENT, INSTRUCTIONS, StudySettings
from lipmotion_studio.study.sources import (
    MadeVideo,
    StudySentence,
    encode_video,
    make_condition,
    parse_conditions,
    read_sentences,
)
from lipmotion_studio.study.trials import anchor_trials, attention_trials, main_trials, practice_trials, shuffled

MAX_TEXT_BYTES = 1 << 16
DEFAULTS = StudySettings()


def design_study(
    output: Path,
    kind: str,
    conditions: Sequence[str],
    sentences: Sequence[Path],
    settings: StudySettings = DEFAULTS,
    monitor: Monitor = silent_monitor,
) -> Study:
    """Make a study: render, encode and name its videos, plan its trials, and write its folder.

    output     : a folder that must not exist
    kind       : ``paired``, ``mos`` or ``ranking``
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
    names, seed = [sentence.name for sentence in spoken], settings.seed
    late = shuffled(names, "anchor", seed)[: settings.anchors]  # the sentences that have an anchor
    if kind == RANKING:  # every page has one, if any has
        late = names if settings.anchors else []
    texts = {"consent": CONSENT, "instructions": INSTRUCTIONS[kind]}
    for name in texts:
        path = getattr(settings, name)
        if path:
            texts[name] = read_text_file(path, name, MAX_TEXT_BYTES).strip()
    with atomic_folder(output) as folder:
        (folder / VIDEOS).mkdir()
        videos: list[StudyVideo] = []
        wanted = [(sentence, name) for sentence in spoken for name in makers]
        for sentence, name in with_progress(wanted, "making videos", monitor):
            made = makers[name](sentence, folder / _UNFINISHED)
            videos.append(_encode(made, sentence, name, folder, settings))
            if name == base and sentence.name in late:
                videos.append(_encode(made, sentence, ANCHOR, folder, settings))
            (folder / _UNFINISHED).unlink(missing_ok=True)
        numbers = {(video.sentence, video.condition): n for n, video in enumerate(videos)}
        trials = main_trials(kind, list(sources), names, numbers)
        with_anchor = [name for name in names if (name, ANCHOR) in numbers]
        anchored = anchor_trials(base, with_anchor, numbers) if kind == PAIRED else []
        checks = attention_trials(kind, trials, settings.checks, seed)
        practice = practice_trials([*trials, *anchored], settings.practice, seed)
        study = Study(
            kind=kind,
            title=settings.title,
            **texts,
            scales=settings.scales if kind == MOS else (),
            seed=seed,
            conditions=sources | ({ANCHOR: f"{base}, sound {settings.anchor_ms:g} ms late"} if late else {}),
            sentences={
                each.name: {"file": each.recording.name, "sha256": sha256_of(each.recording)} for each in spoken
            },
            videos=tuple(videos),
            trials=(*practice, *trials, *anchored, *checks),
            made_by={"lipmotion": installed_version()}
            | {name: str(value) for name, value in asdict(settings).items() if name not in texts},
        )
        write_manifest(study, folder)
    return study


_UNFINISHED = "made.mp4"


def _encode(video: MadeVideo, sentence: StudySentence, name: str, folder: Path, settings: StudySettings) -> StudyVideo:
    """Encode a video as it is shown, and name it by its content."""
    late_ms = settings.anchor_ms if name == ANCHOR else 0.0
    file = folder / VIDEOS / "encoded.mp4"
    seconds = encode_video(video.file, file, sentence.recording, settings.shown_region, late_ms)
    digest = sha256_of(file)
    file.replace(file.with_name(f"{digest[:32]}.mp4"))
    made = video.made | ({"sound_late_ms": f"{late_ms:g}"} if late_ms else {})
    return StudyVideo(f"{digest[:32]}.mp4", sentence.name, name, round(seconds, 3), digest, made)
