"""Design of a study: from conditions and sentences to a folder that raters can be shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import installed_version
from lipmotion.storage.files import atomic_folder, read_text_file, sha256_of
from lipmotion.types import Monitor, silent_monitor
from lipmotion.types.progress import with_progress
from lipmotion_studio.study.answers import ANCHOR, KINDS, MOS, PAIRED, RANKING, RECORDING
from lipmotion_studio.study.encoding import encode_shown
from lipmotion_studio.study.manifest import VIDEOS, Study, StudyTrial, StudyVideo, write_manifest
from lipmotion_studio.study.questions import CONSENT, INSTRUCTIONS
from lipmotion_studio.study.settings import StudySettings
from lipmotion_studio.study.sources import (
    MadeVideo,
    StudySentence,
    condition_of,
    drawn_job,
    named_conditions,
    sentences_of,
)
from lipmotion_studio.study.trials import (
    VideoNumbers,
    anchor_trials,
    attention_trials,
    main_trials,
    practice_trials,
    shuffled,
)

LARGEST_TEXT_BYTES = 1 << 16


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
    sources, said = named_conditions(conditions), sentences_of(sentences)
    drawn = drawn_job(settings.face, settings.fps, settings.recogniser)
    makers = {name: condition_of(source, said, drawn) for name, source in sources.items()}
    base = RECORDING if RECORDING in sources else next(iter(sources))
    late = _late_sentences(kind, said, settings)
    texts = _texts(kind, settings)
    with atomic_folder(output) as folder:
        (folder / VIDEOS).mkdir()
        videos: list[StudyVideo] = []
        wanted = [(sentence, name) for sentence in said for name in makers]
        for sentence, name in with_progress(wanted, "making videos", monitor):
            given = makers[name](sentence, folder / _UNFINISHED)
            videos.append(_shown(given, sentence, name, folder, settings))
            if name == base and sentence.name in late:
                videos.append(_shown(given, sentence, ANCHOR, folder, settings))
            (folder / _UNFINISHED).unlink(missing_ok=True)
        numbers = {(video.sentence, video.condition): n for n, video in enumerate(videos)}
        study = Study(
            kind=kind,
            title=settings.title,
            **texts,
            scales=settings.scales if kind == MOS else (),
            seed=settings.seed,
            conditions=sources | ({ANCHOR: f"{base}, sound {settings.anchor_ms:g} ms late"} if late else {}),
            sentences={each.name: {"file": each.recording.name, "sha256": sha256_of(each.recording)} for each in said},
            videos=tuple(videos),
            trials=_trials(kind, sources, said, numbers, base, settings),
            made_by={"lipmotion": installed_version()}
            | {name: str(value) for name, value in asdict(settings).items() if name not in texts},
        )
        write_manifest(study, folder)
    return study


_UNFINISHED = "made.mp4"


def _late_sentences(kind: str, sentences: Sequence[StudySentence], settings: StudySettings) -> list[str]:
    """Return the names of the sentences that have an anchor; every page of a ranking has one, if any has."""
    names = [sentence.name for sentence in sentences]
    if kind == RANKING:
        return names if settings.anchors else []
    return shuffled(names, "anchor", settings.seed)[: settings.anchors]


def _shown(given: MadeVideo, sentence: StudySentence, name: str, folder: Path, settings: StudySettings) -> StudyVideo:
    """Encode a video as it is shown, and name it by its content."""
    late_ms = settings.anchor_ms if name == ANCHOR else 0.0
    file = folder / VIDEOS / "encoded.mp4"
    seconds = encode_shown(given.file, file, sentence.recording, settings.shown_region, late_ms)
    digest = sha256_of(file)
    file.replace(file.with_name(f"{digest[:32]}.mp4"))
    made = given.made | ({"sound_late_ms": f"{late_ms:g}"} if late_ms else {})
    return StudyVideo(f"{digest[:32]}.mp4", sentence.name, name, round(seconds, 3), digest, made)


def _texts(kind: str, settings: StudySettings) -> dict[str, str]:
    given = {"consent": settings.consent, "instructions": settings.instructions}
    built_in = {"consent": CONSENT, "instructions": INSTRUCTIONS[kind]}
    return {
        name: read_text_file(path, name, LARGEST_TEXT_BYTES).strip() if path else built_in[name]
        for name, path in given.items()
    }


def _trials(
    kind: str,
    conditions: Mapping[str, str],
    sentences: Sequence[StudySentence],
    numbers: VideoNumbers,
    base: str,
    settings: StudySettings,
) -> tuple[StudyTrial, ...]:
    names, seed = [sentence.name for sentence in sentences], settings.seed
    trials = main_trials(kind, list(conditions), names, numbers)
    late = [name for name in names if (name, ANCHOR) in numbers]
    anchored = anchor_trials(base, late, numbers) if kind == PAIRED else []
    checks = attention_trials(kind, trials, settings.checks, seed)
    return (*practice_trials([*trials, *anchored], settings.practice, seed), *trials, *anchored, *checks)
