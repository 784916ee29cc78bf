"""A plain folder of videos, with transcripts beside them where they are known."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.base import Recording, Recordings, videos
from lipmotion.corpora.splits import LISTS, with_splits
from lipmotion.errors import InputError
from lipmotion.units import words_of

KIND = "folder of videos"


def read_folder(directory: Path) -> Recordings:
    """Return the videos in a folder and its sub-folders.

    ``take1.mp4`` may have its words in ``take1.txt``. A video in a sub-folder is named ``sub-take1``.
    """
    by_name: dict[str, list[Path]] = {}
    for path in videos(directory.rglob("*")):
        inner = path.relative_to(directory)
        if not any(part.startswith(".") for part in inner.parts):
            by_name.setdefault("-".join(inner.with_suffix("").parts), []).append(path)
    items, problems = [], {}
    for name, paths in by_name.items():
        try:
            items.append(Recording(name, _only(paths), _words(paths[0].with_suffix(".txt"), directory)))
        except InputError as error:
            problems[name] = str(error)
    items.sort(key=lambda item: item.name)
    return with_splits(Recordings(KIND, tuple(items), problems), directory)


def _only(paths: list[Path]) -> Path:
    if len(paths) > 1:
        raise InputError(f"{len(paths)} videos share this name: {', '.join(map(str, paths))}; rename all but one")
    return paths[0]


def _words(path: Path, directory: Path) -> tuple[str, ...] | None:
    if not path.is_file() or (path.parent == directory and path.name in LISTS):
        return None
    try:
        text = path.read_text(encoding="utf-8-sig")
        return words_of(text) if text.strip() else None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: the transcript is not UTF-8 text; save it as UTF-8") from error
