"""Damaged corpora, and recordings to prepare with bad labels, motion or lists."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from robustness.case import Bench, case, declared, npy
from robustness.motion_cases import GOOD

GROUP = "corpora"
AGAIN = ("not a whole utterance", "delete this folder and prepare again")


def _damaged(name: str, code: int, *messages: str, verb: str = "train") -> Callable[[Callable[[Path], object]], None]:
    """Return a decorator that adds a case with a damaged copy of the corpus.

    verb : the verb that reads it, and its options
    """

    def keep(damage: Callable[[Path], object]) -> None:
        @case(GROUP, name, code, *messages)
        def _(bench: Bench) -> list[object]:
            path = bench.copied_corpus()
            damage(path)
            model = [bench.model] if verb == "evaluate" else []
            return [*verb.split(), *model, path, *(["-o", "m"] if verb.startswith("train") else [])]

    return keep


def _first_training_folder(corpus: Path) -> Path:
    return min(path for path in (corpus / "utterances").iterdir() if _entry(path)["split"] == "train")


def _entry(folder: Path) -> dict[str, Any]:
    entry: dict[str, Any] = json.loads((folder / "entry.json").read_text(encoding="utf-8"))
    return entry


def _change_manifest(corpus: Path, **changes: object) -> None:
    path = corpus / "corpus.json"
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | changes), encoding="utf-8")


def _change_entry(corpus: Path, **changes: object) -> None:
    path = _first_training_folder(corpus) / "entry.json"
    path.write_text(json.dumps(_entry(path.parent) | changes), encoding="utf-8")


PICTURED = "train --visual eigenlips"
_damaged("no mouth pictures for eigenlips", 4, "no mouth pictures, which eigenlips need; prepare", verb=PICTURED)(
    lambda corpus: _change_entry(corpus, crops=False)
)


@_damaged("mouth pictures of another size", 4, "mouth pictures of 2 sizes; prepare", verb=PICTURED)
def _(corpus: Path) -> None:
    first = _first_training_folder(corpus)
    np.save(first / "crops.npy", np.zeros((_entry(first)["frames"], 9, 9, 3), np.uint8))


_damaged(
    "a manifest of 100,000 brackets", 4, "not a corpus (no readable corpus.json); make one: lipmotion corpus prepare"
)(lambda corpus: (corpus / "corpus.json").write_text("[" * 100_000))
_damaged("a newer version", 4, "corpus version 9, this lipmotion reads version 2; upgrade lipmotion")(
    lambda corpus: _change_manifest(corpus, version=9)
)
_damaged("a list of utterances that is a list", 4, "the list of utterances is damaged", "prepare the corpus again")(
    lambda corpus: _change_manifest(corpus, utterances=["a"])
)


@_damaged("an utterance that leads elsewhere", 4, "is not listed as one; prepare the corpus again")
def _(corpus: Path) -> None:
    entry = {"split": "train", "speaker": "", "duration_s": 1, "frames": 1, "unseen_frames": 0}
    _change_manifest(corpus, utterances={"../../elsewhere": entry})


@_damaged("info of a description with a key twice", 4, *AGAIN, "occurs twice", verb="corpus info")
def _(corpus: Path) -> None:
    path = _first_training_folder(corpus) / "entry.json"
    path.write_text(path.read_text(encoding="utf-8").replace("{", '{"name": "a", ', 1), encoding="utf-8")


for _key, _value in {"channels": [{"name": 7, "unit": "a"}], "audio_rate_hz": 0, "phones": [[0, 1]]}.items():

    @_damaged(f"{_key} that are {_value!r}", 4, *AGAIN)
    def _(corpus: Path, key: str = _key, value: object = _value) -> None:
        _change_entry(corpus, **{key: value})


def _array(name: str, array: str, change: Callable[[bytes], bytes], *messages: str) -> None:
    @_damaged(f"{array} {name}", 4, *AGAIN, *messages)
    def _(corpus: Path) -> None:
        path = _first_training_folder(corpus) / f"{array}.npy"
        path.write_bytes(change(path.read_bytes()))


_array("cut off", "audio", lambda content: content[:-20])
_array("of texts", "motion", lambda _: npy(np.array(["a"] * 50)), "holds <U1, required")
_array("of a trillion numbers declared", "features", lambda _: declared("(1000000000000,)"))
_array("of pickled objects", "seen", lambda _: npy(np.array([{}], object)))


@_damaged("an utterance that is a link", 0, verb="corpus info")
def _(corpus: Path) -> None:
    path = _first_training_folder(corpus)
    path.rename(corpus / "moved").rename(corpus.parent / path.name)
    path.symlink_to(corpus.parent / path.name)


RECORDINGS = "recordings of a corpus"


def _recordings_case(name: str, code: int, *messages: str) -> Callable[[Callable[[Bench], object]], None]:
    """Return a decorator that adds a case with a folder of one recording."""

    def keep(lay_out: Callable[[Bench], object]) -> None:
        @case(RECORDINGS, name, code, *messages)
        def _(bench: Bench) -> list[object]:
            lay_out(bench)
            return ["corpus", "prepare", bench.folder, "-o", "corpus", "--workers", "1"]

    return keep


def _write_sentence_with_motion(bench: Bench, name: str = "a") -> None:
    """Write the good sentence with motion beside it."""
    (bench.folder / f"{name}.wav").write_bytes(bench.speech.read_bytes())
    frames = len(bench.samples()) // 160 + 1
    bench.file(f"{name}.json", json.dumps(GOOD | {"values": [[0.1]] * frames}))


NONE = "none of 1 recordings is usable; the first, a:"


def _label_file(name: str, suffix: str, content: bytes | str, *messages: str) -> None:
    @_recordings_case(f"{suffix}: {name}", 4, *messages)
    def _(bench: Bench) -> None:
        _write_sentence_with_motion(bench)
        bench.file(f"a{suffix}", content)


_label_file("binary", ".TextGrid", b"ooBinaryFile\x08TextGrid\x00\xff", "is a binary TextGrid", "save it as plain text")
_label_file("a billion tiers", ".TextGrid", '"ooTextFile"\n"TextGrid"\n0 1 <exists> 1000000000\n', "tier 1 is damaged")
_label_file("phones that overlap", ".lab", "0 2000000 p\n1000000 3000000 aa\n", "before the one ahead of it ends")
_label_file("phones of another recording", ".lab", "0 900000000 p\n", "the sound lasts")
_label_file("more phones than frames", ".lab", "".join(f"{i}0000 {i + 1}0000 p\n" for i in range(2000)),
            "2000 units in time, required at most 1276")  # fmt: skip


def _motion_file(name: str, content: str, *messages: str) -> None:
    @_recordings_case(f"motion: {name}", 4, NONE, *messages)
    def _(bench: Bench) -> None:
        _write_sentence_with_motion(bench)
        bench.file("a.json", content)


_motion_file("of another length", json.dumps(GOOD), "the sound lasts", "required: the same time")
_motion_file("no JSON", "{", "not JSON")


@_recordings_case(
    "a list of 50,000 other names", 4, "name 50000 recordings that are not in it", "those of another folder?"
)
def _(bench: Bench) -> None:
    _write_sentence_with_motion(bench)
    bench.file("train.txt", "".join(f"name{i}\n" for i in range(50_000)))


@_recordings_case("a name in two lists", 4, "a is in train.txt and in test.txt", "keep one")
def _(bench: Bench) -> None:
    _write_sentence_with_motion(bench)
    bench.file("train.txt", "a\n")
    bench.file("test.txt", "a\n")


@case(RECORDINGS, "a corpus where a file is", 7, "is a file; give the name of a new or an empty folder")
def _(bench: Bench) -> list[object]:
    (bench.folder / "recordings").mkdir()
    _write_sentence_with_motion(bench, "recordings/a")
    return ["corpus", "prepare", bench.folder / "recordings", "-o", bench.file("taken", "")]
