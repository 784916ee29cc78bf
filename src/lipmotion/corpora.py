"""A corpus on disk: a manifest and one folder an utterance."""

from __future__ import annotations

import atexit
import shutil
import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError, MissingDependencyError, shorten_list
from lipmotion.extensions import install_command
from lipmotion.storage.files import TEMPORARY, atomic_file, confine, make_folder, make_portable, replace_folder
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.locks import open_temporary, remove_unfinished
from lipmotion.storage.schema import ArraySpec, check_sizes
from lipmotion.storage.sources import check_regular, read_text_file
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

SPLITS = ("train", "val", "test")
ENTRY = "entry.json"
LARGEST_FEATURE = 1e3  # no feature has a larger magnitude; features are standardised
UTTERANCE_ARRAYS = {
    "audio": ArraySpec(np.int16, "N"),
    "features": ArraySpec(np.float32, "T D", -LARGEST_FEATURE, LARGEST_FEATURE),
    "motion": ArraySpec(np.float32, "F P"),
    "seen": ArraySpec(np.bool_, "F"),
    "crops": ArraySpec(np.uint8, "F H W 3", optional=True),
}
"""The arrays of an utterance: N samples, T frames of sound, F frames of motion."""
BLOCK = 1 << 20  # samples that are quantised at a time
LARGEST_NUMBER = 1e9  # no utterance has more seconds or frames, nor more frames a second


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
    if not is_utterance_name(utterance.name) or make_portable(utterance.name) != utterance.name:
        required = "required the name of a visible folder, on Windows, too"
        raise InputError(f"an utterance cannot be named {utterance.name!r}, {required}")
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
        "checksums": {name: zlib.crc32(array.tobytes()) for name, array in arrays.items()},
    }
    if crops is not None:  # read only where they are used, without a checksum
        arrays["crops"] = crops.astype(np.uint8)
    with replace_folder(folder) as unfinished:
        for name, array in arrays.items():
            np.save(unfinished / f"{name}.npy", array)
        text = as_json(description, indent=1, sort_keys=True, ensure_ascii=False)
        (unfinished / ENTRY).write_text(text + "\n", encoding="utf-8")
        if folder.exists():
            shutil.rmtree(folder)


_TEXT, _COUNT = text(1 << 24), number(0, LARGEST_NUMBER)
_CHANNEL = {"name": _TEXT, "unit": _TEXT}
_NEEDED = {
    **{"name": _TEXT, "speaker": _TEXT, "split": one_of(SPLITS), "words": optional(items(_TEXT)), "crops": truth},
    **{"source": any_members(_TEXT), "settings": any_members(lambda value: value), "audio_rate_hz": whole(1, 1 << 31)},
    **{"channels": items(members(_CHANNEL, _CHANNEL, alone=True))},
    **dict.fromkeys(("duration_s", "rate_hz", "frames", "unseen_frames"), _COUNT),
}
_ENTRY = members(_NEEDED | {"notes": items(_TEXT), "checksums": any_members(lambda value: value)}, _NEEDED)
"""What of the description is used, and its types. Without ``checksums``, only impossible arrays are noticed."""


def read_entry(folder: Path) -> dict[str, Any]:
    """Return the description of an utterance, checked. Raises CorpusError: missing or damaged."""
    try:
        entry: dict[str, Any] = from_json(read_text_file(folder / ENTRY, "description"))
        _ENTRY(entry)
    except (OSError, ValueError) as error:
        raise _damaged(folder, error) from error
    return entry


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


FORMAT = "lipmotion.corpus"
VERSION = 2  # version 2 has speakers, labelled phones and motion of any kind
MANIFEST = "corpus.json"
UTTERANCES = "utterances"


@dataclass(frozen=True)
class Selection:
    """Some utterances of a corpus.

    split    : the list ``train``, ``val`` or ``test``; None: all utterances
    speakers : theirs only; empty: all speakers
    names    : exactly these utterances, whatever their list and speaker

    >>> Selection("val", speakers=("s1",))
    Selection(split='val', speakers=('s1',), names=None)
    """

    split: str | None = "train"
    speakers: Sequence[str] = ()
    names: Sequence[str] | None = None


class Corpus:
    """Prepared recordings on disk. Reading them needs neither OpenCV nor MediaPipe.

    path : the folder
    Open one with ``Corpus.open``, make or extend one with ``Corpus.create``.

    >>> corpus = Corpus.open("my-corpus")
    >>> corpus.utterance(corpus.names("train")[0]).features.values.shape[1]
    39
    """

    def __init__(
        self, path: Path, index: dict[str, dict[str, Any]], fetch: Callable[[str], None] | None = None
    ) -> None:
        self.path = path
        self._index, self._fetch = index, fetch

    @classmethod
    def open(cls, path: str | Path) -> Corpus:
        """Return an existing corpus.

        path : its folder, or a URL of one that fsspec reads, as ``s3://BUCKET/NAME``; its utterances are copied when
               they are first read, into a temporary folder that lasts as long as this process. Nothing is added to it
        Raises CorpusError: missing, not a corpus, or of a newer version. MissingDependencyError: a URL needs fsspec, or
        a package of its kind.
        """
        if "://" in str(path):
            folder, fetch = _open_remote(str(path))
            fetch(MANIFEST)
            return cls(folder, cls.open(folder)._index, fetch)
        path = Path(path)
        try:
            is_there = path.is_dir()
        except PermissionError as error:
            raise CorpusError(f"{path}: cannot be read: {error.strerror}; ask its owner, or copy it") from error
        if not is_there and not path.exists():
            raise CorpusError(f"{path}: no such corpus; make one: lipmotion corpus prepare RECORDINGS -o {path}")
        try:
            content = from_json(read_text_file(path / MANIFEST, "manifest"))
            format_name, version = content["format"], content["version"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            found = f"not a corpus (no readable {MANIFEST})"
            raise CorpusError(f"{path}: {found}; make one: lipmotion corpus prepare {path} -o CORPUS") from error
        file = path / MANIFEST
        if format_name != FORMAT:
            raise CorpusError(f"{file}: format is {format_name!r}, required {FORMAT!r}; give a prepared corpus")
        if version != VERSION:
            found = f"corpus version {version}, this lipmotion reads version {VERSION}"
            raise CorpusError(f"{file}: {found}; upgrade lipmotion, or prepare the recordings again in a new folder")
        try:
            index: dict[str, dict[str, Any]] = content["utterances"]
            _INDEX(index)
        except (KeyError, InputError) as error:
            what = f"the list of utterances is damaged ({error})"
            raise CorpusError(f"{file}: {what}; prepare the corpus again") from error
        if wrong := [name for name in index if not is_utterance_name(name)]:
            raise CorpusError(f"{file}: the utterance {wrong[0]!r} is not listed as one; prepare the corpus again")
        return cls(path, index)

    @classmethod
    def create(cls, path: Path) -> Corpus:
        """Return a corpus to add to: an existing one, or a new one in a new or empty folder.

        Raises CorpusError: the folder holds something else. Raises ExportError: it cannot be created.
        """
        if not (path / MANIFEST).is_file():
            if path.exists() and (not path.is_dir() or any(not x.name.startswith(TEMPORARY) for x in path.iterdir())):
                raise CorpusError(f"{path}: exists and is not a corpus; give a new or an empty folder")
            make_folder(path)
            cls(path, {})._write_manifest()
        corpus = cls.open(path)
        with confine(path):
            make_folder(path / UTTERANCES)
        remove_unfinished(path)
        remove_unfinished(path / UTTERANCES)
        return corpus

    def __len__(self) -> int:
        return len(self._index)

    @property
    def speakers(self) -> dict[str, tuple[int, float]]:
        """The number of utterances and of seconds of each speaker, sorted by name; "" where the speaker is unknown."""
        spoken: dict[str, list[float]] = {}
        for entry in self._index.values():
            spoken.setdefault(entry["speaker"], []).append(float(entry["duration_s"]))
        return {speaker: (len(seconds), sum(seconds)) for speaker, seconds in sorted(spoken.items())}

    def names(self, split: str | None = None, speakers: Sequence[str] = ()) -> tuple[str, ...]:
        """Return the sorted names of the utterances of one split or of all, and of some speakers or of all."""
        entries = self._index.items()
        chosen = {name: entry for name, entry in entries if split in (None, entry["split"])}
        return tuple(sorted(name for name, entry in chosen.items() if not speakers or entry["speaker"] in speakers))

    def divided(self, lists: Mapping[str, Collection[str]]) -> Corpus:
        """Return the same corpus with some of its utterances alone, in other lists ``train``, ``val`` and ``test``.

        Nothing may be added to what is returned: the manifest on disk is that of the whole.
        """
        entries = {name: {**self._index[name], "split": split} for split, names in lists.items() for name in names}
        return Corpus(self.path, entries, self._fetch)

    def required(self, split: str | None, speakers: Sequence[str] = ()) -> tuple[str, ...]:
        """Return the same names as ``names``, at least one. Raises CorpusError: there are none, or no such speaker."""
        unknown = sorted(set(speakers) - set(self.speakers))
        if unknown:
            known = ", ".join(filter(None, self.speakers)) or "no speaker by name"
            raise CorpusError(f"{self.path}: no speaker {unknown[0]!r} (there are: {known})")
        names = self.names(split, speakers)
        if not names:
            counts = ", ".join(f"{each}: {len(self.names(each, speakers))}" for each in SPLITS)
            who = f" by {', '.join(speakers)}" if speakers else ""
            found = f"no utterances of split {split!r}{who} (there are {counts})"
            raise CorpusError(f"{self.path}: {found}; choose another, or list some in test.txt and prepare these again")
        return names

    def selected(self, selection: Selection) -> tuple[str, ...]:
        """Return the names of the utterances of a selection. Raises CorpusError: there are none, or no such speaker."""
        if selection.names is None:
            return self.required(selection.split, selection.speakers)
        if not selection.names:
            raise CorpusError(f"{self.path}: an empty list of names was given; name at least one utterance")
        return tuple(selection.names)

    def summary(self) -> dict[str, str]:
        """Return a description of the corpus for users, by keyword."""
        seconds, frames, unseen = (sum(entry[name] for entry in self._index.values()) for name in _COUNTS)
        sources = [read_entry(self.folder(name)) for name in self.names()]
        speakers = []
        for speaker, (count, spoken_s) in self.speakers.items():
            length = f"{spoken_s / 60:.1f} minutes" if spoken_s >= 60 else f"{spoken_s:.1f} seconds"
            speakers.append(f"{speaker or 'unknown'} ({count}, {length})")
        motions = set()
        for entry in sources:
            names = [channel["name"] for channel in entry["channels"]]
            motions.add(f"{len(names)} channels ({shorten_list(names, 3)}) at {entry['rate_hz']:g} Hz")
        rights = sorted({entry["source"]["attribution"] for entry in sources if "attribution" in entry["source"]})
        return {
            "corpus": str(self.path),
            "utterances": f"{len(self)} ({', '.join(f'{len(self.names(split))} {split}' for split in SPLITS)})",
            "transcribed": str(sum(entry["words"] is not None for entry in sources)),
            "labelled": f"{sum(entry.get('phones') is not None for entry in sources)} with phones in time",
            "minutes": f"{seconds / 60:.1f}",
            "speakers": ", ".join(speakers),
            "frames": f"{frames}, {unseen} without a face",
            "motion": "; ".join(sorted(motions)),
            "attribution": "; ".join(rights) or "none stated",
        }

    def folder(self, name: str) -> Path:
        """Return the folder of an utterance of this name, whether or not it exists."""
        if self._fetch is not None and name in self._index:
            self._fetch(f"{UTTERANCES}/{name}")
        return self.path / UTTERANCES / name

    def utterance(self, name: str) -> Utterance:
        """Return one utterance; its large arrays stay on disk until they are used.

        Raises CorpusError: there is none of that name, or it is damaged.
        """
        if name not in self._index:
            some = shorten_list(self.names())
            raise CorpusError(f"{self.path}: no utterance {name!r} among {len(self)} ({some})")
        folder = self.folder(name)
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
            for array, checksum in entry.get("checksums", {}).items():
                if array in arrays and zlib.crc32(arrays[array].tobytes()) != checksum:
                    raise ValueError(f"{array} holds other bytes than were written")
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
                speaker=entry["speaker"],
                phones=None if phones is None else Timeline(tuple(phones)),
            )
        except (OSError, EOFError, ValueError, KeyError, TypeError, OverflowError) as error:
            raise _damaged(folder, error) from error

    def add(self, utterance: Utterance, settings: dict[str, str] | None = None) -> None:
        """Write one utterance, replace one of the same name, and add it to the manifest.

        settings : as of ``write_utterance``
        Raises InputError: its name cannot be a folder's. Raises ExportError: it cannot be written.
        """
        if self._fetch is not None:
            raise CorpusError(f"{self.path.name}: a corpus by URL is only read; copy it to add {utterance.name!r}")
        folder = self.folder(utterance.name)
        with confine(self.path):
            write_utterance(folder, utterance, settings or {})
        self._index[utterance.name] = _summary(read_entry(folder))
        self._write_manifest()

    def refresh(self) -> None:
        """Write the manifest anew from the utterances on disk: several processes may have written them."""
        folders = sorted(path for path in (self.path / UTTERANCES).iterdir() if path.is_dir())
        self._index = {path.name: _summary(read_entry(path)) for path in folders if not path.name.startswith(".")}
        self._write_manifest()

    def _write_manifest(self) -> None:
        content = {"format": FORMAT, "version": VERSION, "utterances": self._index}
        with confine(self.path), atomic_file(self.path / MANIFEST) as unfinished:
            text = as_json(content, indent=1, sort_keys=True, ensure_ascii=False)
            unfinished.write_text(text + "\n", encoding="utf-8")


def _open_remote(url: str) -> tuple[Path, Callable[[str], None]]:
    """Return a temporary folder, and what copies a file or a folder of files there, by its path in a corpus by URL."""
    try:
        from fsspec.core import url_to_fs

        system, root = url_to_fs(url)
    except ImportError as error:
        raise MissingDependencyError(f"{url}: {error}; {install_command('cluster')}") from error
    except Exception as error:  # every kind of file system has errors of its own
        raise CorpusError(f"{url}: cannot be opened ({error}); give a folder by URL, as s3://BUCKET/NAME") from error
    stack = ExitStack()
    folder = stack.enter_context(open_temporary()) / (Path(root).name or "corpus")
    atexit.register(stack.close)

    def fetch(part: str) -> None:
        place, source = folder / part, f"{root.rstrip('/')}/{part}"
        if place.exists():
            return
        make_folder(place.parent)
        try:
            if not system.isdir(source):
                with atomic_file(place) as file:
                    file.write_bytes(system.cat_file(source))
                return
            with replace_folder(place) as unfinished:
                for name in system.ls(source, detail=False):
                    (unfinished / Path(name).name).write_bytes(system.cat_file(name))
        except Exception as error:
            address = f"{url.rstrip('/')}/{part}"
            raise CorpusError(f"{address}: cannot be read ({error!r}); is it a prepared corpus?") from error

    return folder, fetch


def _summary(entry: dict[str, Any]) -> dict[str, Any]:
    return {key: entry[key] for key in ("split", "speaker", *_COUNTS)}


_COUNTS = ("duration_s", "frames", "unseen_frames")
_LISTED = {"split": one_of(SPLITS), "speaker": text(1 << 20)} | dict.fromkeys(_COUNTS, number(0, LARGEST_NUMBER))
_INDEX = any_members(members(_LISTED, _LISTED))
