"""Damaged corpora, and recordings to prepare with bad labels, motion or lists."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


@_damaged("no mouth pictures for eigenlips", 4, "no mouth pictures, which eigenlips need; prepare", verb=PICTURED)
def _(corpus: Path) -> None:
    _change_entry(corpus, crops=False)


@_damaged("mouth pictures of another size", 4, "mouth pictures of 2 sizes; prepare", verb=PICTURED)
def _(corpus: Path) -> None:
    first = _first_training_folder(corpus)
    np.save(first / "crops.npy", np.zeros((_entry(first)["frames"], 9, 9, 3), np.uint8))


for _name, _damage in {
    "without its manifest": lambda corpus: (corpus / "corpus.json").unlink(),
    "a manifest that is no JSON": lambda corpus: (corpus / "corpus.json").write_text("{"),
    "a manifest of 100,000 brackets": lambda corpus: (corpus / "corpus.json").write_text("[" * 100_000),
}.items():
    _damaged(_name, 4, "not a corpus (no readable corpus.json); give a prepared corpus")(_damage)


@_damaged("a newer version", 4, "corpus version 9, this lipmotion reads versions up to 2; upgrade lipmotion")
def _(corpus: Path) -> None:
    _change_manifest(corpus, version=9)


for _name, _list in {
    "a list of utterances that is none": 7,
    "a list of utterances that is a list": ["a"],
    "an utterance that is a number": {"a": 7},
    "an utterance without an end": {"a": {"split": "train"}},
}.items():

    @_damaged(_name, 4, "the list of utterances is damaged", "prepare the corpus again")
    def _(corpus: Path, content: object = _list) -> None:
        _change_manifest(corpus, utterances=content)


for _name in ("../../elsewhere", "/etc", ".hidden", "a/b", ""):

    @_damaged(f"an utterance named {_name!r}", 4, "is not listed as one; prepare the corpus again")
    def _(corpus: Path, name: str = _name) -> None:
        entry = {"split": "train", "duration_s": 1, "frames": 1, "unseen_frames": 0}
        _change_manifest(corpus, utterances={name: entry})


@_damaged("an utterance that is not there", 4, *AGAIN)
def _(corpus: Path) -> None:
    shutil.rmtree(_first_training_folder(corpus))


@_damaged("a description that is no JSON", 4, *AGAIN)
def _(corpus: Path) -> None:
    (_first_training_folder(corpus) / "entry.json").write_text("{")


@_damaged("info of a description that is no JSON", 4, *AGAIN, verb="corpus info")
def _(corpus: Path) -> None:
    (_first_training_folder(corpus) / "entry.json").write_text("{")


for _key, _value in {
    "words": [1, 2],
    "source": 7,
    "channels": [{"name": 7, "unit": "a"}],
    "audio_rate_hz": 0,
    "rate_hz": "fast",
    "split": "tomorrow",
    "speaker": ["a"],
    "phones": [[0, 1]],
}.items():

    @_damaged(f"{_key} that are {_value!r}", 4, *AGAIN)
    def _(corpus: Path, key: str = _key, value: object = _value) -> None:
        _change_entry(corpus, **{key: value})


for _array in ("audio", "features", "motion", "seen"):

    @_damaged(f"without its {_array}", 4, *AGAIN)
    def _(corpus: Path, name: str = _array) -> None:
        (_first_training_folder(corpus) / f"{name}.npy").unlink()

    @_damaged(f"{_array} cut off", 4, *AGAIN)
    def _(corpus: Path, name: str = _array) -> None:
        path = _first_training_folder(corpus) / f"{name}.npy"
        path.write_bytes(path.read_bytes()[:-20])

    @_damaged(f"{_array} of texts", 4, *AGAIN, "holds <U1, required")
    def _(corpus: Path, name: str = _array) -> None:
        (_first_training_folder(corpus) / f"{name}.npy").write_bytes(npy(np.array(["a"] * 50)))

    @_damaged(f"{_array} of another shape", 4, *AGAIN)
    def _(corpus: Path, name: str = _array) -> None:
        path = _first_training_folder(corpus) / f"{name}.npy"
        path.write_bytes(npy(np.load(path, allow_pickle=False)[:5][None]))

    @_damaged(f"{_array} of a trillion numbers declared", 4, *AGAIN)
    def _(corpus: Path, name: str = _array) -> None:
        (_first_training_folder(corpus) / f"{name}.npy").write_bytes(declared("(1000000000000,)"))

    @_damaged(f"{_array} of pickled objects", 4, *AGAIN)
    def _(corpus: Path, name: str = _array) -> None:
        (_first_training_folder(corpus) / f"{name}.npy").write_bytes(npy(np.array([{}], object)))


for _array in ("features", "motion"):

    @_damaged(f"NaN in {_array}", 4, *AGAIN, "not finite")
    def _(corpus: Path, name: str = _array) -> None:
        path = _first_training_folder(corpus) / f"{name}.npy"
        values = np.load(path, allow_pickle=False)
        values[3, 0] = np.nan
        np.save(path, values)


def _remade(name: str, array: str, remake: Callable[[NDArray[Any]], NDArray[Any]], *messages: str, verb: str) -> None:
    @_damaged(f"{array} {name}: {verb}", 4, *AGAIN, *messages, verb=verb)
    def _(corpus: Path) -> None:
        for folder in (corpus / "utterances").iterdir():
            path = folder / f"{array}.npy"
            np.save(path, remake(np.load(path, allow_pickle=False)))


for _verb in ("train", "evaluate"):
    _remade("times 1e6", "motion", lambda a: a * 1e6, "required within", verb=_verb)
    _remade("complex", "motion", lambda a: a.astype(complex), "holds complex", verb=_verb)
    _remade("times 1e6", "features", lambda a: a * 1e6, "required -1000 to 1000", verb=_verb)
    _remade("of dates", "features", lambda a: a.astype("i8").astype("M8[s]"), "holds datetime64", verb=_verb)
    _remade("in 32 bits", "audio", lambda a: a.astype(np.float32), "holds float32", verb=_verb)
    _remade("of numbers", "seen", lambda a: a.astype(np.int64), "holds int64", verb=_verb)
    _remade("a frame shorter", "seen", lambda a: a[1:], "seen of shape", verb=_verb)
    _remade("a channel narrower", "motion", lambda a: a[:, 1:], "motion of shape", verb=_verb)


_remade("times 1e6", "motion", lambda a: a * 1e6, "required within", verb="experiment unit-sets")

for _array in ("audio", "features", "motion", "seen"):

    @_damaged(f"bytes flipped in the middle of {_array}", 4, *AGAIN)
    def _(corpus: Path, name: str = _array) -> None:
        path = _first_training_folder(corpus) / f"{name}.npy"
        content = bytearray(path.read_bytes())
        middle = 128 + (len(content) - 128) // 2
        content[middle : middle + 4] = bytes(byte ^ 1 for byte in content[middle : middle + 4])
        path.write_bytes(content)


@_damaged("a description with a key twice", 4, *AGAIN, "occurs twice")
def _(corpus: Path) -> None:
    path = _first_training_folder(corpus) / "entry.json"
    path.write_text(path.read_text(encoding="utf-8").replace("{", '{"name": "a", ', 1), encoding="utf-8")


@_damaged("an array that is a device", 4, *AGAIN, "pipe or a device")
def _(corpus: Path) -> None:
    path = _first_training_folder(corpus) / "audio.npy"
    path.unlink()
    path.symlink_to("/dev/zero")


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
_recordings_case("an empty folder", 4, "no videos in it, and no sounds with motion")(lambda bench: bench)
_recordings_case("an empty video", 4, NONE, "the file is empty")(lambda bench: (bench.folder / "a.mp4").touch())
_recordings_case("a text named .mp4", 4, NONE, "not a readable")(lambda bench: bench.file("a.mp4", "hello " * 500))


def _label_file(name: str, suffix: str, content: bytes | str, *messages: str) -> None:
    @_recordings_case(f"{suffix}: {name}", 4, *messages)
    def _(bench: Bench) -> None:
        _write_sentence_with_motion(bench)
        bench.file(f"a{suffix}", content)


ONE_TIER = '"ooTextFile"\n"TextGrid"\n0 1 <exists> 1\n"IntervalTier" "a" 0 1'
_label_file("binary", ".TextGrid", b"ooBinaryFile\x08TextGrid\x00\xff", "binary TextGrid; save it as a text file")
_label_file("cut off", ".TextGrid", 'File type = "ooTextFile"\n"TextGrid"\n0\n1\n<exists>\n1\n', "is damaged")
_label_file("a billion tiers", ".TextGrid", '"ooTextFile"\n"TextGrid"\n0 1 <exists> 1000000000\n', "tier 1 is damaged")
_label_file("a tier of a billion labels", ".TextGrid", '"ooTextFile"\n"TextGrid"\n0 1 <exists> 1\n"IntervalTier" "a" '
            '0 1 1000000000\n0 1 "b"\n', "more than 250000 labels; give those of one recording")  # fmt: skip
_label_file("half a tier", ".TextGrid", '"ooTextFile"\n"TextGrid"\n0 1 <exists> 0.5\n', "is damaged")
_label_file("times of NaN", ".TextGrid", '"ooTextFile"\n"TextGrid"\n0 nan <exists> 1\n', "is damaged")
_label_file("times of 1e999", ".TextGrid", '"ooTextFile"\n"TextGrid"\n0 1 <exists> 1e999\n', "is damaged")
_label_file("phones that overlap", ".lab", "0 2000000 p\n1000000 3000000 aa\n", "before the one ahead of it ends")
_label_file("phones with a gap", ".lab", "0 1000000 p\n2000000 3000000 aa\n", "without a gap: label silence as sil")
_label_file("an unknown phone", ".lab", "0 1000000 p\n1000000 2000000 aa\n2000000 3000000 b\n3000000 4000000 qq\n",
          "line 4 is 'qq', which is no phone")  # fmt: skip
_label_file("a line of another form", ".lab", "0 1000000 p\nhello\n", "line 2 is 'hello'; required, as in line 1")
_label_file("phones of another recording", ".lab", "0 900000000 p\n", "the sound lasts")
_label_file("a backward label of Audacity", ".txt", "1.5\t0.5\tp\n", "before its start")
_label_file("no UTF-8", ".txt", b"\xff\xfeh", "a.txt")
_label_file("an end of 5,000 digits", ".lab", f"0 {'9' * 5000} p\n", "line 1 has the time 999", "required a finite one")
_label_file("an infinite time", ".TextGrid", f'{ONE_TIER} 1\n0 1e999 "p"\n',
          "has the time 1e999, required a finite one")  # fmt: skip
_label_file("more labels than its counts say", ".TextGrid", f'{ONE_TIER} 1\n'
          '0 1 "p"\n1 2 "aa"\n', "more is there than the counts say")  # fmt: skip
_label_file("250,001 labels", ".lab", "0 1000000 p\n" * 250_001, "more than 250000 labels; give those of one recording")
_label_file("more phones than frames", ".lab", "".join(f"{i}0000 {i + 1}0000 p\n" for i in range(2000)),
          "2000 units in time, required at most 1276")  # fmt: skip
_label_file(
    "labels in seconds without decimals in the first line", ".txt", "0 0.5 p\n0.5 1.5 aa\n", "its lines hold times"
)
_label_file("many recordings in one", ".lab", '#!MLF!#\n"*/a.lab"\n0 1000000 p\n', "is a master label file")
_label_file(
    "damaged times", ".srt", "1\n00:00:01,000 --> 7\nhello\n", "a.srt: line 2 is '00:00:01,000 --> 7'; required times"
)
_label_file("damaged JSON", ".json", '{"segments": [\n', "a.json: line 2: damaged JSON")
_label_file("two recordings", ".ctm", "a 1 0.0 0.5 hi\nb 1 0.5 0.5 you\n", "a.ctm: line 2: words of two recordings")
_label_file("a word processor's file", ".txt", "{\\rtf1\\ansi hello}", "required the words alone; save it as text")
_label_file("UTF-16 without its mark", ".txt", "hello".encode("utf-16-le"), "holds NUL characters: is it UTF-16")
_label_file(
    "two million words", ".txt", "a " * 2_000_000, "the transcript has 4000000 characters, required at most 10552"
)
_label_file(
    "a file of 5 MB", ".txt", "a" * 5_000_000, "5000000 characters, required at most 4194304: is it a transcript?"
)
_label_file("a file of 20 MB", ".TextGrid", b" " * 20_000_000, "20000000 bytes, required at most 16777216")


def _motion_file(name: str, content: str, *messages: str) -> None:
    @_recordings_case(f"motion: {name}", 4, NONE, *messages)
    def _(bench: Bench) -> None:
        _write_sentence_with_motion(bench)
        bench.file("a.json", content)


_motion_file("of another length", json.dumps(GOOD), "the sound lasts", "required: the same time")
_motion_file("NaN", json.dumps(GOOD | {"values": [[float("nan")]]}), "not finite")
_motion_file("no JSON", "{", "not JSON")
_motion_file("a channel that is a spreadsheet's formula",
       json.dumps(GOOD | {"channels": [{"name": "=1+1", "unit": "weight"}]}),
       "begins as a spreadsheet's formula")  # fmt: skip


def _weights(name: str, values: bytes, *messages: str, names: bytes | None = None, code: int = 4) -> None:
    @_recordings_case(f"FACEGOOD: {name}", code, *messages)
    def _(bench: Bench) -> None:
        (bench.folder / "a.wav").write_bytes(bench.speech.read_bytes())
        bench.file("bs_value_a.npy", values)
        bench.file("x_bs_name.npy", names or npy(np.array(["jaw", "smile"])))


_weights("pickled objects", npy(np.array([{}], object)), NONE, "save it with numpy.save")
_weights("a trillion frames declared", declared("(1000000000000, 2)"), NONE, "required 16000000000000 bytes")
_weights("a zip", b"PK\5\6" + bytes(18), NONE, "not an array")
_weights("NaN", npy(np.full((9, 2), np.nan)), NONE, "not finite; interpolate them first")
_weights("another count of channels", npy(np.zeros((9, 3))), NONE, "required numbers of shape (frames, 2)")
_weights("names that are numbers", npy(np.zeros((9, 2))), "required one row of different texts", names=npy(np.zeros(2)),
         code=3)  # fmt: skip


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


@case(RECORDINGS, "a corpus in the place of a recording", 7, "lies in the folder of recordings")
def _(bench: Bench) -> list[object]:
    _write_sentence_with_motion(bench)
    return ["corpus", "prepare", bench.folder, "-o", bench.folder / "a.wav"]


@case(RECORDINGS, "a folder that is not there", 3, "no such folder; give a folder of recordings")
def _(bench: Bench) -> list[object]:
    return ["corpus", "prepare", bench.folder / "none", "-o", "corpus"]


@case(RECORDINGS, "a recording instead of a folder", 3, "is a file; give the folder of recordings that it is in")
def _(bench: Bench) -> list[object]:
    return ["corpus", "prepare", bench.speech, "-o", "corpus"]
