"""A corpus on disk: a manifest and one folder an utterance."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lipmotion.corpora.entry import LARGEST_NUMBER, is_utterance_name, read_entry, read_utterance, write_utterance
from lipmotion.corpora.source_recordings import SPLITS
from lipmotion.errors import CorpusError, InputError
from lipmotion.storage.files import TEMPORARY, atomic_file, confine, make_folder, read_text_file, remove_unfinished
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.types import Utterance
from lipmotion.types.values import any_members, members, number, one_of, text

FORMAT = "lipmotion.corpus"
VERSION = 2
"""Version 2 has speakers, labelled phones and motion of any kind. Version 1 can be read; its speakers and phones are
unknown."""
READ_VERSIONS = (1, 2)
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

    >>> import tempfile
    >>> from pathlib import Path
    >>> from lipmotion.testing import toy_utterances
    >>> folder = tempfile.TemporaryDirectory()
    >>> corpus = Corpus.create(Path(folder.name) / "toy")
    >>> corpus.add(toy_utterances(3)[0])
    >>> Corpus.open(corpus.path).names("train"), corpus.utterance("toy00").features.values.shape[1]
    (('toy00',), 39)
    >>> folder.cleanup()
    """

    def __init__(self, path: Path, index: dict[str, dict[str, Any]]) -> None:
        self.path = path
        self._index = index

    @classmethod
    def open(cls, path: str | Path) -> Corpus:
        """Return an existing corpus. Raises CorpusError: missing, not a corpus, or of a newer version."""
        path = Path(path)
        try:
            is_there = path.is_dir()
        except PermissionError as error:
            raise CorpusError(f"{path}: cannot be read: {error.strerror}; ask its owner, or copy it") from error
        if not is_there:
            raise CorpusError(f"{path}: no such corpus; make one: lipmotion corpus prepare RECORDINGS -o {path}")
        try:
            content = from_json(read_text_file(path / MANIFEST, "manifest"))
            format_name, version = content["format"], content["version"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise CorpusError(f"{path}: not a corpus (no readable {MANIFEST}); give a prepared corpus") from error
        file = path / MANIFEST
        if format_name != FORMAT:
            raise CorpusError(f"{file}: format is {format_name!r}, required {FORMAT!r}; give a prepared corpus")
        if version not in READ_VERSIONS:
            raise CorpusError(
                f"{file}: corpus version {version}, this lipmotion reads versions up to {VERSION}; "
                "upgrade lipmotion, or prepare the recordings again into a new folder"
            )
        try:
            index: dict[str, dict[str, Any]] = content["utterances"]
            _INDEX(index)
        except (KeyError, InputError) as error:
            what = f"the list of utterances is damaged ({error})"
            raise CorpusError(f"{file}: {what}; prepare the corpus again") from error
        for name in index:
            if not is_utterance_name(name):
                raise CorpusError(f"{file}: the utterance {name!r} is not listed as one; prepare the corpus again")
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
    def splits(self) -> dict[str, int]:
        """The number of utterances of train, val and test."""
        return {split: len(self.names(split)) for split in SPLITS}

    @property
    def speakers(self) -> dict[str, tuple[int, float]]:
        """The number of utterances and of seconds of each speaker, sorted by name; "" where the speaker is unknown."""
        spoken: dict[str, list[float]] = {}
        for entry in self._index.values():
            spoken.setdefault(entry.get("speaker", ""), []).append(float(entry["duration_s"]))
        return {speaker: (len(seconds), sum(seconds)) for speaker, seconds in sorted(spoken.items())}

    def names(self, split: str | None = None, speakers: Sequence[str] = ()) -> tuple[str, ...]:
        """Return the sorted names of the utterances of one split or of all, and of some speakers or of all."""
        return tuple(
            sorted(
                name
                for name, entry in self._index.items()
                if split in (None, entry["split"]) and (not speakers or entry.get("speaker", "") in speakers)
            )
        )

    def part(self, names: Collection[str]) -> Corpus:
        """Return the same corpus with some of its utterances alone. Raises CorpusError: a name that it does not have.

        Nothing may be added to what is returned: the manifest on disk is that of the whole.
        """
        for name in names:
            if name not in self._index:
                raise CorpusError(f"{self.path}: no utterance {name!r} among {len(self)}")
        return Corpus(self.path, {name: self._index[name] for name in names})

    def required(self, split: str | None, speakers: Sequence[str] = ()) -> tuple[str, ...]:
        """Return the same names as ``names``, at least one.

        Raises CorpusError: there are none, or no such speaker.
        """
        unknown = sorted(set(speakers) - set(self.speakers))
        if unknown:
            known = ", ".join(filter(None, self.speakers)) or "no speaker by name"
            raise CorpusError(f"{self.path}: no speaker {unknown[0]!r} (there are: {known})")
        names = self.names(split, speakers)
        if not names:
            counts = ", ".join(f"{each}: {len(self.names(each, speakers))}" for each in SPLITS)
            who = f" by {', '.join(speakers)}" if speakers else ""
            raise CorpusError(
                f"{self.path}: no utterances of split {split!r}{who} (there are {counts}); choose another split, or "
                "name recordings in a list beside them, test.txt for instance, and prepare them again (docs/corpora.md)"
            )
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
        seconds = sum(float(entry["duration_s"]) for entry in self._index.values())
        frames = sum(int(entry["frames"]) for entry in self._index.values())
        unseen = sum(int(entry["unseen_frames"]) for entry in self._index.values())
        sources = [read_entry(self.folder(name)) for name in self.names()]
        speakers = []
        for speaker, (count, spoken_s) in self.speakers.items():
            length = f"{spoken_s / 60:.1f} minutes" if spoken_s >= 60 else f"{spoken_s:.1f} seconds"
            speakers.append(f"{speaker or 'unknown'} ({count}, {length})")
        motions = set()
        for entry in sources:
            names = [channel["name"] for channel in entry["channels"]]
            some = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
            motions.add(f"{len(names)} channels ({some}) at {entry['rate_hz']:g} Hz")
        rights = sorted({entry["source"]["attribution"] for entry in sources if "attribution" in entry["source"]})
        return {
            "corpus": str(self.path),
            "utterances": f"{len(self)} ({', '.join(f'{count} {split}' for split, count in self.splits.items())})",
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
        return self.path / UTTERANCES / name

    def utterance(self, name: str) -> Utterance:
        """Return one utterance; its large arrays stay on disk until they are used.

        Raises CorpusError: there is none of that name, or it is damaged.
        """
        if name not in self._index:
            some = ", ".join(self.names()[:5])
            raise CorpusError(f"{self.path}: no utterance {name!r} among {len(self)} ({some}, ...)")
        return read_utterance(self.folder(name))

    def add(self, utterance: Utterance, settings: dict[str, str] | None = None) -> None:
        """Write one utterance, replace one of the same name, and add it to the manifest.

        settings : as of ``write_utterance``
        Raises InputError: its name cannot be a folder's. Raises ExportError: it cannot be written.
        """
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


def _summary(entry: dict[str, Any]) -> dict[str, Any]:
    listed = {key: entry[key] for key in ("split", "duration_s", "frames", "unseen_frames")}
    return listed | {"speaker": entry.get("speaker", "")}


_COUNTS = ("duration_s", "frames", "unseen_frames")
_LISTED = {"split": one_of(SPLITS)} | dict.fromkeys(_COUNTS, number(0, LARGEST_NUMBER))
_INDEX = any_members(members(_LISTED | {"speaker": text(1 << 20)}, _LISTED))
