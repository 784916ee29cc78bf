"""One utterance on disk: a folder of arrays that can be memory-mapped, and a JSON description."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.files import whole_folder
from lipmotion.types import Audio, Channel, Features, Motion, Span, Timeline, Track, Unit, Utterance

ENTRY = "entry.json"
KEYS = frozenset(
    "name words split audio_rate_hz duration_s rate_hz frames unseen_frames channels crops source settings".split()
)
"""What every description holds. ``speaker`` and ``phones`` came with version 2 of the corpus; without them: unknown."""
FULL_SCALE = 32_768
"""16-bit samples per unit of amplitude: recordings of 16 bits come back exactly."""


def quantised(audio: Audio) -> Audio:
    """Return the sound as a corpus keeps it, in 16 bits, so that its features can be computed again from there."""
    return Audio(_as_float(_as_int16(audio.samples)), audio.rate_hz)


def write_utterance(folder: Path, utterance: Utterance, settings: dict[str, str]) -> None:
    """Write one utterance; ``folder`` appears whole, in the place of one that is there.

    settings : what the result depends on besides the source; kept to see whether it is up to date
    Raises InputError: the name cannot be a folder's. Raises ExportError: it cannot be written.
    """
    if not utterance.name or utterance.name != Path(utterance.name).name or utterance.name.startswith("."):
        raise InputError(f"an utterance cannot be named {utterance.name!r}: required: the name of a visible folder")
    with whole_folder(folder) as unfinished:
        for name, array in _arrays(utterance).items():
            np.save(unfinished / f"{name}.npy", array)
        text = json.dumps(_description(utterance, settings), indent=1, sort_keys=True, ensure_ascii=False)
        (unfinished / ENTRY).write_text(text + "\n", encoding="utf-8")
        if folder.exists():
            shutil.rmtree(folder)


def read_entry(folder: Path) -> dict[str, Any]:
    """Return the description of an utterance. Raises CorpusError: missing or damaged."""
    try:
        entry = json.loads((folder / ENTRY).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise _damaged(folder, error) from error
    if not isinstance(entry, dict) or not entry.keys() >= KEYS:
        raise _damaged(folder, KeyError(f"{ENTRY} holds other keys than {', '.join(sorted(KEYS))}"))
    return entry


def read_utterance(folder: Path) -> Utterance:
    """Return one utterance, its features and mouth images left on disk until they are used.

    Raises CorpusError: missing or damaged.
    """
    entry = read_entry(folder)
    try:
        audio = Audio(_as_float(_load(folder, "audio")), entry["audio_rate_hz"])
        channels = tuple(Channel(**channel) for channel in entry["channels"])
        motion = Motion(_load(folder, "motion").astype(np.float64), entry["rate_hz"], channels)
        crops = _load(folder, "crops") if entry["crops"] else None
        return Utterance(
            name=entry["name"],
            audio=audio,
            features=Features(_load(folder, "features"), audio.duration_s),
            track=Track(motion, np.array(_load(folder, "seen")), crops, tuple(entry.get("notes", ()))),
            words=None if entry["words"] is None else tuple(entry["words"]),
            split=entry["split"],
            source=entry["source"],
            speaker=entry.get("speaker", ""),
            phones=_timeline(entry.get("phones")),
        )
    except (OSError, EOFError, ValueError, KeyError, TypeError) as error:
        raise _damaged(folder, error) from error


def _arrays(utterance: Utterance) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {
        "audio": _as_int16(utterance.audio.samples),
        "features": utterance.features.values.astype(np.float32),
        "motion": utterance.track.motion.values.astype(np.float32),
        "seen": utterance.track.seen.astype(np.bool_),
    }
    if utterance.track.crops is not None:
        arrays["crops"] = utterance.track.crops.astype(np.uint8)
    return arrays


def _description(utterance: Utterance, settings: dict[str, str]) -> dict[str, Any]:
    motion, seen = utterance.track.motion, utterance.track.seen
    return {
        "name": utterance.name,
        "words": utterance.words,
        "split": utterance.split,
        "speaker": utterance.speaker,
        "phones": None if utterance.phones is None else [[s.start_s, s.end_s, s.label.phone] for s in utterance.phones],
        "audio_rate_hz": utterance.audio.rate_hz,
        "duration_s": utterance.audio.duration_s,
        "rate_hz": motion.rate_hz,
        "frames": len(seen),
        "unseen_frames": int((~seen).sum()),
        "channels": [asdict(channel) for channel in motion.channels],
        "crops": utterance.track.crops is not None,
        "notes": utterance.track.notes,
        "source": utterance.source,
        "settings": settings,
    }


def _timeline(rows: Any) -> Timeline[Unit] | None:
    """Return phones in time. Raises ValueError: not rows of start, end and phone, in order."""
    if rows is None:
        return None
    return Timeline(tuple(Span(float(start_s), float(end_s), Unit(str(phone))) for start_s, end_s, phone in rows))


def _load(folder: Path, name: str) -> NDArray[Any]:
    array: NDArray[Any] = np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False)
    return array


def _as_int16(samples: NDArray[np.float32]) -> NDArray[np.int16]:
    return np.clip(np.rint(samples * FULL_SCALE), -FULL_SCALE, FULL_SCALE - 1).astype(np.int16)


def _as_float(samples: NDArray[np.int16]) -> NDArray[np.float32]:
    return samples.astype(np.float32) / np.float32(FULL_SCALE)


def _damaged(folder: Path, error: Exception) -> CorpusError:
    return CorpusError(f"{folder}: not a whole utterance ({error!r}); delete this folder and prepare again")
