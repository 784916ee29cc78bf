"""Arguments that are a text or the name of a file that holds it."""

from __future__ import annotations

from pathlib import Path

from lipmotion.pipeline.transcribe import read_transcript


def text_or_file(argument: str) -> str:
    """Return the content of a file of that name, else the argument itself.

    Raises InputError: it looks like a file's name but there is none, or the file is not UTF-8 text.
    """
    path = Path(argument)
    looks_like_one = path.suffix == ".txt" and " " not in argument
    return read_transcript(path) if looks_like_one or _is_there(path) else argument


def _is_there(path: Path) -> bool:
    """Whether there is a file of that name, or a pipe or a device; a word may be a folder's name."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):  # too long for a file's name, or with a character that none can have
        return False
