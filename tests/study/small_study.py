"""A small study of each kind, and raters written as programs: nobody watches anything here."""

from hashlib import sha256
from pathlib import Path
from typing import Any

from lipmotion_studio.study import manifest, settings
from lipmotion_studio.study.answers import ANCHOR, MOS, PAIRED

CONDITIONS = ("recording", "visemes", "phones")
SENTENCES = ("one", "two", "three", "four", "five", "six")
VALUES = {PAIRED: "first", MOS: "3"}


def sha256_of(path: Path) -> str:
    return sha256(path.read_bytes()).hexdigest()


def small_study(
    folder: Path, kind: str = PAIRED, *, sentences: tuple[str, ...] = SENTENCES, content: bytes = b"a video of "
) -> manifest.Study:
    """Write a study whose videos are not videos into a new folder, and return it."""
    (folder / manifest.VIDEOS).mkdir(parents=True)
    videos = []
    for sentence in sentences:
        for condition in (*CONDITIONS, *([ANCHOR] if sentence == sentences[0] else [])):
            data = content + f"{sentence} by {condition}".encode()
            digest = sha256(data).hexdigest()
            videos.append(manifest.StudyVideo(f"{digest[:32]}.mp4", sentence, condition, 0.5, digest, {"made": "test"}))
            (folder / manifest.VIDEOS / videos[-1].file).write_bytes(data)
    return planned(folder, kind, sentences, videos)


def planned(folder: Path, kind: str, sentences: tuple[str, ...], videos: list[manifest.StudyVideo]) -> manifest.Study:
    """Write the manifest of a study with one trial for practice and one that checks attention, and return it."""
    numbers = {(video.sentence, video.condition): n for n, video in enumerate(videos)}
    trials = manifest.make_main_trials(kind, CONDITIONS, sentences, numbers)
    anchors = manifest.make_anchor_trials("recording", sentences[:1], numbers) if kind == PAIRED else []
    study = manifest.Study(
        kind=kind,
        title="A study",
        consent="You agree.\nReally.",
        instructions="Watch.",
        scales=tuple(settings.SCALES) if kind == MOS else (),
        seed=3,
        conditions={name: name for name in CONDITIONS},
        sentences={name: {"file": name} for name in sentences},
        videos=tuple(videos),
        trials=(
            *manifest.make_practice_trials(trials, 1, 3),
            *trials,
            *anchors,
            *manifest.make_attention_trials(kind, trials, 1, 3),
        ),
        made_by={"lipmotion": "test"},
    )
    manifest.write_manifest(study, folder)
    return study


def scripted_answer(study: manifest.Study, place: dict[str, Any], value: str = "") -> dict[str, Any]:
    """Return what the page would send for a trial, in whose place a rater is."""
    count, asked = len(place["videos"]), len(manifest.list_questions(study, study.trials[0]))
    return {
        "trial": place["trial"],
        "values": [value or VALUES[study.kind]] * asked,
        "plays": [1] * count,
        "seconds": 0.5 * count,
    }
