"""One utterance of a corpus on disk: a folder of arrays that can be memory-mapped, and a JSON description."""

from __future__ import annotations

import shutil
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.source_recordings import SPLITS
from lipmotion.errors import CorpusError, InputError
from lipmotion.storage.files import atomic_folder, check_regular, portable_name, read_text_file
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.schema import ArraySpec, check_sizes
from lipmotion.types import (
    FRAME_RATE_HZ,
    Audio,
    Channel,
    Features,
    Motion,
    Span,
    Timeline,
    Track,
    Unit,
    Utterance,
    check_curves,
    from_sixteen_bits,
    to_sixteen_bits,
)
from lipmotion.types.values import any_members, items, members, number, one_of, optional, text, truth, whole

ENTRY = "entry.json"
KEYS = frozenset(
    "name words split audio_rate_hz duration_s rate_hz frames unseen_frames channels crops source settings".split()
)
"""The keys of every description. ``speaker`` and ``phones`` came with version 2 of the corpus; without them both are
unknown. ``checksums`` came later; without them, only impossible arrays are noticed."""
LARGEST_FEATURE = 1e3
"""No feature has a larger magnitude; features are standardised."""
UTTERANCE_ARRAYS = {
    "audio": ArraySpec(np.int16, "N"),
    "features": ArraySpec(np.float32, "T D", -LARGEST_FEATURE, LARGEST_FEATURE),
    "motion": ArraySpec(np.float32, "F P"),
    "seen": ArraySpec(np.bool_, "F"),
    "crops": ArraySpec(np.uint8, "F H W 3", optional=True),
}
"""The arrays of an utterance: N samples, T frames of sound, F frames of motion."""
BLOCK = 1 << 20
"""Samples that are quantised at a time."""
LARGEST_NUMBER = 1e9
"""No utterance has more seconds or frames, nor more frames a second."""


def quantise(audio: Audio) -> Audio:
    """Return sound quantised to 16 bits, as files hold it: features computed of it can be computed again."""
    samples = np.empty(len(audio.samples), np.float32)
    for start in range(0, len(samples), BLOCK):
        block = slice(start, start + BLOCK)
        samples[block] = from_sixteen_bits(to_sixteen_bits(audio.samples[block]))
    return Audio(samples, audio.rate_hz)


def is_utterance_name(name: str) -> bool:
    """Return whether an utterance can have this name: that of a visible folder, without other folders before it."""
    return bool(name) and name == Path(name).name and not name.startswith(".") and "\0" not in name


def write_utterance(folder: Path, utterance: Utterance, settings: dict[str, str]) -> None:
    """Write one utterance; ``folder`` appears complete, and replaces an existing one.

    settings : what the utterance depends on besides its source; they tell later whether it is up to date
    Raises InputError: the name cannot be a folder's, or the motion cannot be that of a face.
    Raises ExportError: it cannot be written.
    """
    if not is_utterance_name(utterance.name) or portable_name(utterance.name) != utterance.name:
        raise InputError(
            f"an utterance cannot be named {utterance.name!r}: required: the name of a visible folder, on Windows, too"
        )
    motion, seen = utterance.track.motion, utterance.track.seen
    crops, phones = utterance.track.crops, utterance.phones
    check_curves(motion)
    arrays: dict[str, NDArray[Any]] = {
        "audio": to_sixteen_bits(utterance.audio.samples),
        "features": utterance.features.values.astype(np.float32),
        "motion": motion.values.astype(np.float32),
        "seen": seen.astype(np.bool_),
    }
    description = {
        "name": utterance.name,
        "words": utterance.words,
        "split": utterance.split,
        "speaker": utterance.speaker,
        "phones": None if phones is None else [[s.start_s, s.end_s, s.label.phone] for s in phones],
        "audio_rate_hz": utterance.audio.rate_hz,
        "duration_s": utterance.audio.duration_s,
        "rate_hz": motion.rate_hz,
        "frames": len(seen),
        "unseen_frames": int((~seen).sum()),
        "channels": [asdict(channel) for channel in motion.channels],
        "crops": crops is not None,
        "notes": utterance.track.notes,
        "source": utterance.source,
        "settings": settings,
        "checksums": {name: _checksum(array) for name, array in arrays.items()},
    }
    if crops is not None:  # read only where they are used, without a checksum
        arrays["crops"] = crops.astype(np.uint8)
    with atomic_folder(folder) as unfinished:
        for name, array in arrays.items():
            np.save(unfinished / f"{name}.npy", array)
        text = as_json(description, indent=1, sort_keys=True, ensure_ascii=False)
        (unfinished / ENTRY).write_text(text + "\n", encoding="utf-8")
        if folder.exists():
            shutil.rmtree(folder)


_TEXT, _COUNT = text(1 << 24), number(0, LARGEST_NUMBER)
_CHANNEL = {"name": _TEXT, "unit": _TEXT}
_ENTRY = members(
    {
        **{"name": _TEXT, "speaker": _TEXT, "split": one_of(SPLITS), "words": optional(items(_TEXT))},
        **{"source": any_members(_TEXT), "notes": items(_TEXT), "settings": any_members(lambda value: value)},
        **{"checksums": any_members(lambda value: value), "audio_rate_hz": whole(1, 1 << 31), "crops": truth},
        **{"channels": items(members(_CHANNEL, _CHANNEL, alone=True))},
        **dict.fromkeys(("duration_s", "rate_hz", "frames", "unseen_frames"), _COUNT),
    },
    KEYS,
)
"""What of the description is used, and its types."""


def read_entry(folder: Path) -> dict[str, Any]:
    """Return the description of an utterance, checked. Raises CorpusError: missing or damaged."""
    try:
        entry: dict[str, Any] = from_json(read_text_file(folder / ENTRY, "description"))
        _ENTRY(entry)
    except (OSError, ValueError) as error:
        raise _damaged(folder, error) from error
    return entry


def read_utterance(folder: Path) -> Utterance:
    """Return one utterance; its features and mouth pictures stay on disk until they are used.

    Raises CorpusError: missing or damaged.
    """
    entry = read_entry(folder)
    try:
        channels = tuple(Channel(**channel) for channel in entry["channels"])
        arrays = {name: _load(folder, name) for name in UTTERANCE_ARRAYS if name != "crops" or entry["crops"]}
        sizes = check_sizes(arrays, UTTERANCE_ARRAYS, P=len(channels), F=entry["frames"])
        audio = Audio(from_sixteen_bits(arrays["audio"]), entry["audio_rate_hz"])
        expected = int(audio.duration_s * FRAME_RATE_HZ + 1e-9) + 1
        if sizes["T"] != expected:
            raise ValueError(f"{sizes['T']} frames of features, required {expected} for {audio.duration_s:.2f} s")
        motion = Motion(arrays["motion"].astype(np.float64), entry["rate_hz"], channels)
        check_curves(motion)
        for name, checksum in entry.get("checksums", {}).items():
            if name in arrays and _checksum(arrays[name]) != checksum:
                raise ValueError(f"{name} holds other bytes than were written")
        phones = entry.get("phones")
        if phones is not None:
            phones = [Span(_COUNT(start_s), _COUNT(end_s), Unit(_TEXT(phone))) for start_s, end_s, phone in phones]
        return Utterance(
            name=entry["name"],
            audio=audio,
            features=Features(arrays["features"], audio.duration_s),
            track=Track(motion, np.array(arrays["seen"]), arrays.get("crops"), tuple(entry.get("notes", ()))),
            words=None if entry["words"] is None else tuple(entry["words"]),
            split=entry["split"],
            source=entry["source"],
            speaker=entry.get("speaker", ""),
            phones=None if phones is None else Timeline(tuple(phones)),
        )
    except (OSError, EOFError, ValueError, KeyError, TypeError, OverflowError) as error:
        raise _damaged(folder, error) from error


def _checksum(array: NDArray[Any]) -> int:
    return zlib.crc32(array.tobytes())


def _load(folder: Path, name: str) -> NDArray[Any]:
    """Return an array, memory-mapped: a file shorter than its header says is noticed before anything is allocated."""
    path = folder / f"{name}.npy"
    check_regular(path, "array")
    try:
        array: NDArray[Any] = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError):
        raise
    except Exception as error:  # the header is parsed as Python, which can fail in many ways
        raise ValueError(f"{path.name}: not an array ({type(error).__name__}: {error})") from error
    return array


def _damaged(folder: Path, error: Exception) -> CorpusError:
    return CorpusError(f"{folder}: not a whole utterance ({error!r}); delete this folder and prepare again")
