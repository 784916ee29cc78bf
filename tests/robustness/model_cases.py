"""Damaged model files."""

from __future__ import annotations

import io
import json
import struct
import warnings
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustness.case import Bench, case, declared, npy

GROUP = "models"
Remake = Callable[[NDArray[Any]], NDArray[Any]]
NO_MODEL = ("not a lipmotion model", "give a file that `lipmotion train` wrote")
DAMAGED = ("damaged", "train or download")


def _file(name: str, content: bytes, *messages: str) -> None:
    @case(GROUP, name, 6, *messages)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--model", bench.file("m.lipmotion", content))


_file("an empty file", b"", *NO_MODEL)
_file("a text", b"hello", *NO_MODEL)
_file("an empty zip", b"PK\5\6" + bytes(18), *NO_MODEL)


for _share in (0.1, 0.5, 0.999):

    @case(GROUP, f"cut off at {_share:.1%}", 6, *NO_MODEL)
    def _(bench: Bench, share: float = _share) -> list[object]:
        content = bench.model.read_bytes()
        return bench.animate(None, "--model", bench.file("m.lipmotion", content[: int(share * len(content))]))


@case(GROUP, "flipped bytes in a member", 6, *DAMAGED)
def _(bench: Bench) -> list[object]:
    content = bytearray(bench.model.read_bytes())
    with zipfile.ZipFile(bench.model) as file:
        member = file.getinfo("phones/means.npy")
    place = member.header_offset + 100
    content[place : place + 8] = bytes(byte ^ 255 for byte in content[place : place + 8])
    return bench.animate(None, "--model", bench.file("m.lipmotion", bytes(content)))


def _header(name: str, *messages: str, **header: object) -> None:
    @case(GROUP, name, 6, *messages)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--model", bench.changed_model({}, **header))


_header("a newer version", "model version 9, this lipmotion reads version 3; upgrade lipmotion", version=9)
_header("another format", *NO_MODEL, format="other")
_header(
    "an unknown engine",
    "no engine 'quantum'; there are: trajectory",
    "install the package that adds it",
    engine="quantum",
)
_header("an engine that is a list", "no engine []; there are: trajectory", engine=[])
_header("an unknown option", *DAMAGED, "no option 'colour'", configuration={"colour": 1})
_header("an option that is a text", *DAMAGED, configuration={"states": "5"})
_header("an option of NaN", *NO_MODEL, "the number NaN, required a finite one", configuration={"edge_s": float("nan")})
_header("more parts than the model has", *DAMAGED, configuration={"states": 9})
_header("a recogniser's option that is a text", *DAMAGED, recogniser={"bigram_weight": "much"})


def _changed(name: str, member: str, content: bytes | None, *messages: str) -> None:
    @case(GROUP, name, 6, *messages)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--model", bench.changed_model({member: content}))


_changed("without its header", "header.json", None, *NO_MODEL)
_changed("a header of 100,000 brackets", "header.json", b"[" * 100_000, *NO_MODEL)
_changed("without an array", "phones/means.npy", None, *DAMAGED)
_changed("without an array of the engine", "engine/variances.npy", None, *DAMAGED)
_changed("a member that is not an array", "phones/means.npy", b"hello", *DAMAGED, "not an array")
_changed("a trillion numbers declared", "phones/means.npy", declared("(1000000000000,)"), *DAMAGED, "in 0 bytes")
_changed("texts of no length", "phones/names.npy", declared("(1000000000000,)", "<U0"), *DAMAGED)
_changed("a hundred megabytes of zeros", "phones/means.npy", bytes(2**27), *NO_MODEL, "would grow to", "at most")
_changed("pickled objects", "phones/means.npy", npy(np.array([{}], object)), *DAMAGED)
_changed("a path to elsewhere", "../../elsewhere.npy", npy(np.zeros(3)), *DAMAGED)
_changed("units that are numbers", "phones/units.npy", npy(np.zeros(3)), *DAMAGED)
_changed("no silent unit", "phones/free.npy", npy(np.array([], "<U3")), *DAMAGED)


def _array(name: str, member: str, value: float, *messages: str) -> None:
    @case(GROUP, name, 6, *DAMAGED, *messages)
    def _(bench: Bench) -> list[object]:
        array = bench.array(member)
        array.reshape(-1)[0] = value
        return bench.animate(None, "--model", bench.changed_model({f"{member}.npy": npy(array)}))


_array("NaN among means", "phones/means", np.nan, "means holds values that are not finite")
_array("a variance of 0", "phones/variances", 0, "variances holds 0 to", "required more than 0")
_array("a probability over 1", "phones/log_stay", 0.5, "log_stay holds", "to less than 0")
_array("a unit without states", "phones/counts", -1)
_array("NaN among the means of the engine", "engine/means", np.nan, "not finite")
_array("NaN in the acoustic regression", "engine/coefficients", np.nan, "not finite")
_array("a tree with an unknown question", "engine/asked", 10**6, "tree")
_array("a gain of 0", "engine/gain", 0, "gain holds 0 to", "required more than 0")
_array("an infinite variance of the engine", "engine/variances", np.inf, "not finite")
_array("a negative variance of the engine", "engine/variances", -1, "required more than 0")
_array("a channel that is not there", "engine/direct", 10**6, "direct channels")


def _changed_array(name: str, member: str, remake: Remake, *messages: str, of: str = "model") -> None:
    @case(GROUP, name, 6, *(messages or DAMAGED))
    def _(bench: Bench) -> list[object]:
        whole = getattr(bench, of)
        content = npy(remake(bench.array(member, whole)))
        return bench.animate(None, "--model", bench.changed_model({f"{member}.npy": content}, whole))


FAR = ("the motion would go from", "the model is damaged; train or download it again")
_changed_array("coefficients times 1000", "engine/coefficients", lambda a: a.astype(float) * 1000, *FAR)
_changed_array("means times 1000", "engine/means", lambda a: a.astype(float) * 1000, *DAMAGED, "of their deviations")
_changed_array(
    "complex means", "engine/means", lambda a: a.astype(complex), *DAMAGED, "holds complex128, required fractions"
)
_changed_array(
    "means that are dates", "engine/means", lambda a: a.astype("i8").astype("M8[s]"), *DAMAGED, "holds datetime64"
)
_changed_array("probabilities that do not sum to 1", "phones/bigram", lambda a: a * 0, *DAMAGED, "whose sum is")
_changed_array("a question of a fourth neighbour", "engine/questions", lambda a: np.where(a == "0", "3", a))
for _member, _remake in {
    "means": lambda a: a.astype(complex),
    "variances": lambda a: -a,
    "log_weights": lambda a: a + 1,
    "tie": lambda a: a + 10**6,
    "streams": lambda a: a + 9,
}.items():
    _changed_array(f"coupled: impossible {_member}", f"engine/group_1/{_member}", _remake, of="coupled")
_changed_array("coupled: a bigram times 1000", "engine/chain_0/bigram", lambda a: a * 1000, of="coupled")
_changed_array("coupled: a scale times 1000", "engine/visual_0/scale", lambda a: a * 1000, of="coupled")
_changed_array("coupled: NaN in rest", "engine/rest", lambda a: a * np.nan, of="coupled")
_changed_array("coupled: rest times 1000", "engine/rest", lambda a: a * 1000, *DAMAGED, "rest pose of", of="coupled")
_changed_array("coupled: one state less", "engine/chain_0/advance", lambda a: a[:1], of="coupled")
_changed_array("coupled: a transposed basis", "engine/around/basis", lambda a: a.T, of="coupled")
_changed_array(
    "coupled: acoustic regression times 1000",
    "engine/following_0/coefficients",
    lambda a: a.astype(float) * 1000,
    *FAR,
    of="coupled",
)
LIPS = ("the eigenlips are damaged", "train the model again")
_changed_array("eigenlips: times 1000", "eigenlips/basis", lambda a: a * 1000, *LIPS, of="pictured")
_changed_array(
    "eigenlips: equal components",
    "eigenlips/basis",
    lambda a: a[:, :1] + 0 * a,
    *LIPS,
    "orthonormal",
    of="pictured",
)
_changed_array("eigenlips: a negative size", "eigenlips/size", lambda a: -a, *LIPS, "size holds", of="pictured")
_changed_array("eigenlips: a mean of NaN", "eigenlips/mean", lambda a: a * np.nan, *LIPS, "not finite", of="pictured")
_changed_array("eigenlips: a colour less", "eigenlips/basis", lambda a: a[:2], *LIPS, "basis of shape", of="pictured")
_changed_array("eigenlips: complex", "eigenlips/basis", lambda a: a.astype(complex), *LIPS, "complex", of="pictured")

_changed("an array that nothing declares", "engine/more.npy", npy(np.zeros(3)), *DAMAGED, "undeclared 'more'")
_changed("a part that nothing declares", "more/means.npy", npy(np.zeros(3)), *DAMAGED, "undeclared 'more/means'")
_changed("a member that is no array", "engine/notes.txt", b"hello", *DAMAGED, "undeclared 'engine/notes.txt'")
_changed("a header with a key twice", "header.json", b'{"format": "lipmotion.model", "format": "other"}', *NO_MODEL,
         "the key 'format' occurs twice")  # fmt: skip
_changed("a header of 1e999", "header.json", b'{"format": "lipmotion.model", "version": 1e999}', *NO_MODEL, "1e999")
_header("an option of a billion", *DAMAGED, "required at most", configuration={"states": 10**9 + 1})
_header("a million states", *DAMAGED, engine="joint", configuration={"states": 10**6})
_header("an option that is true", *DAMAGED, "required a whole number", configuration={"states": True})
_header("a truth value that is a text", *DAMAGED, "required true or false", configuration={"acoustic_regression": "no"})


@case(GROUP, "a member that is there twice", 6, *NO_MODEL, "is in it twice")
def _(bench: Bench) -> list[object]:
    path = bench.changed_model({})
    with warnings.catch_warnings(), zipfile.ZipFile(path, "a") as file:
        warnings.simplefilter("ignore")
        file.writestr("engine/means.npy", npy(bench.array("engine/means")))
    return bench.animate(None, "--model", path)


@case(GROUP, "a compression that NumPy never uses", 6, *NO_MODEL, "required: deflated or stored")
def _(bench: Bench) -> list[object]:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_LZMA) as file:
        file.writestr("header.json", json.dumps({"format": "lipmotion.model"}))
    return bench.animate(None, "--model", bench.file("m.lipmotion", content.getvalue()))


@case(GROUP, "a wrong size of a member", 6, *DAMAGED)
def _(bench: Bench) -> list[object]:
    content = bytearray(bench.model.read_bytes())
    place = content.rindex(b"PK\1\2")
    content[place + 24 : place + 28] = struct.pack("<I", 5)
    return bench.animate(None, "--model", bench.file("m.lipmotion", bytes(content)))


@case(GROUP, "a recording as a model", 6, *NO_MODEL)
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--model", bench.speech)


@case(GROUP, "a device", 3, "no such model; train one")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--model", "/dev/zero")


@case(GROUP, "info of a damaged one", 6, *NO_MODEL)
def _(bench: Bench) -> list[object]:
    return ["info", bench.file("m.lipmotion", "hello")]


@case(GROUP, "an adaptation of a wrong shape", 6, "the adaptation is damaged", "adapt the model again")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--model", bench.changed_model({"adaptation/own.npy": npy(np.zeros((39, 39)))}))


@case(GROUP, "eigenlips of a wrong shape", 6, "the eigenlips are damaged", "train the model again")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--model", bench.changed_model({"eigenlips/mean.npy": npy(np.zeros((3, 9)))}))


_header(
    "eigenlips that the header claims", "the model says visual 'both', which its eigenlips do not fit", visual="both"
)
