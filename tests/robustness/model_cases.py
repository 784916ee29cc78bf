"""Models."""

from __future__ import annotations

import io
import json
import struct
import zipfile

import numpy as np

from robustness.case import Bench, case, declared, npy

GROUP = "models"
NO_MODEL = ("not a lipmotion model", "give a file that `lipmotion train` wrote")
DAMAGED = ("damaged", "train or download")


def _file(name: str, content: bytes, *says: str) -> None:
    @case(GROUP, name, 6, *says)
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


def _header(name: str, *says: str, **header: object) -> None:
    @case(GROUP, name, 6, *says)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--model", bench.changed_model({}, **header))


_header("a newer version", "model version 9, this lipmotion reads version 3; upgrade lipmotion", version=9)
_header("another format", *NO_MODEL, format="other")
_header("an unknown engine", *DAMAGED, "no engine 'quantum'; there are: trajectory", engine="quantum")
_header("an engine that is a list", *DAMAGED, engine=[])
_header("an unknown option", *DAMAGED, "unexpected keyword argument", configuration={"colour": 1})
_header("an option that is a text", *DAMAGED, configuration={"parts": "5"})
_header("an option of NaN", *DAMAGED, configuration={"edge_s": float("nan")})
_header("more parts than were learned", *DAMAGED, configuration={"parts": 9})
_header("a recogniser's option that is a text", *DAMAGED, recogniser={"bigram_weight": "much"})


def _changed(name: str, member: str, content: bytes | None, *says: str) -> None:
    @case(GROUP, name, 6, *says)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--model", bench.changed_model({member: content}))


_changed("without its header", "header.json", None, *NO_MODEL)
_changed("a header of 100,000 brackets", "header.json", b"[" * 100_000, *NO_MODEL)
_changed("without an array", "phones/means.npy", None, *DAMAGED)
_changed("without what the engine learned", "engine/variances.npy", None, *DAMAGED)
_changed("an array that is none", "phones/means.npy", b"hello", *DAMAGED, "not an array")
_changed("a trillion numbers declared", "phones/means.npy", declared("(1000000000000,)"), *DAMAGED, "in 0 bytes")
_changed("texts of no length", "phones/names.npy", declared("(1000000000000,)", "<U0"), *DAMAGED)
_changed("a hundred megabytes of nothing", "phones/means.npy", bytes(2**27), *NO_MODEL, "would grow to", "at most")
_changed("pickled objects", "phones/means.npy", npy(np.array([{}], object)), *DAMAGED)
_changed("a path to elsewhere", "../../elsewhere.npy", npy(np.zeros(3)), *DAMAGED)
_changed("units that are numbers", "phones/units.npy", npy(np.zeros(3)), *DAMAGED)
_changed("no silent unit", "phones/free.npy", npy(np.array([], "<U3")), *DAMAGED)


def _array(name: str, member: str, value: float, *says: str) -> None:
    @case(GROUP, name, 6, *DAMAGED, *says)
    def _(bench: Bench) -> list[object]:
        array = bench.array(member)
        array.reshape(-1)[0] = value
        return bench.animate(None, "--model", bench.changed_model({f"{member}.npy": npy(array)}))


_array("NaN among means", "phones/means", np.nan, "means holds values that are not finite")
_array("a variance of 0", "phones/variances", 0, "variances not more than 0")
_array("a probability over 1", "phones/log_stay", 0.5, "probabilities not less than 1")
_array("a state without states", "phones/counts", -1)
_array("NaN in what the engine learned", "engine/means", np.nan, "not finite")
_array("NaN in how the engine follows the sound", "engine/coefficients", np.nan, "not finite")
_array("a tree that asks what there is not", "engine/asked", 10**6, "tree")
_array("a gain of 0", "engine/gain", 0, "a gain")
_array("an infinite variance of the engine", "engine/variances", np.inf, "not finite")
_array("a negative variance of the engine", "engine/variances", -1, "not more than 0")
_array("a channel that is not there", "engine/direct", 10**6, "direct channels")


@case(GROUP, "a compression that NumPy never uses", 6, *NO_MODEL, "required: deflated or stored")
def _(bench: Bench) -> list[object]:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_LZMA) as file:
        file.writestr("header.json", json.dumps({"format": "lipmotion.model"}))
    return bench.animate(None, "--model", bench.file("m.lipmotion", content.getvalue()))


@case(GROUP, "a size that lies", 6, *DAMAGED)
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


_header("eigenlips that it says it has", "the model says visual 'both', which its eigenlips do not fit", visual="both")
