import io
import json
import zipfile

import numpy as np

from robustness.case import Bench, case, declared, npy

GROUP = "motion files"
DAMAGED = ("the motion document is damaged", "export it again")
GOOD = {
    "format": "lipmotion.motion",
    "version": 1,
    "rate_hz": 100.0,
    "channels": [{"name": "opening", "unit": "eye_distance"}],
    "values": [[0.1], [0.2]],
    "units": [
        {"start_s": 0.0, "end_s": 0.4, "phone": "sil", "unit": ""},
        {"start_s": 0.4, "end_s": 0.6, "phone": "p", "unit": ""},
    ],
}


def _unit(start_s: object, end_s: object, phone: object = "p") -> dict[str, object]:
    return {"start_s": start_s, "end_s": end_s, "phone": phone, "unit": ""}


def _json(name: str, text: str | dict[str, object], code: int, *messages: str) -> None:
    content = text if isinstance(text, str) else json.dumps(GOOD | text)
    case(GROUP, f"json: {name}", code, *messages)(
        lambda bench: bench.animate(None, "--units", bench.file("units.json", content))
    )


_json("units that overlap", {"units": [_unit(0, 0.5), _unit(0.4, 0.6)]}, 3,
      "starts at 0.4 s, before the previous span ends")  # fmt: skip
_json("a unit at NaN s", {"units": [_unit(float("nan"), 0.4)]}, 3, "start_s is nan, required a finite number")
_json("a unit that ends in a million years", {"units": [_unit(0, 3e13)]}, 0, "the units go on to",
      "those of another recording?")  # fmt: skip
_json("an unknown phone", {"units": [_unit(0, 0.4, "qq")]}, 3, "unknown phone 'qq' at 0.0 s; the phones:")
_json("a time of 400 digits", {"units": [_unit(10**400, 0.4)]}, 3, *DAMAGED)
_json("two million units", json.dumps(GOOD | {"units": []}).replace("[]", "[" + "0," * 2_000_000 + "0]"), 3, *DAMAGED,
      "a list of more than 1048576 items")  # fmt: skip
_json("no units", {"units": []}, 3, "the units are an empty list", "or leave them out")
_json("an infinite rate", {"rate_hz": float("inf")}, 3, "rate_hz is inf, required a finite number")
_json("a channel that is a spreadsheet's formula", {"channels": [{"name": "=1+1", "unit": "weight"}]}, 3,
      "the channel name '=1+1' begins as a spreadsheet's formula")  # fmt: skip
_json("100,000 brackets", '{"values": ' + "[" * 100_000, 3, "not JSON", "export it again")


def _npz(name: str, values: bytes, *messages: str, document: bytes | None = None) -> None:
    @case(GROUP, f"npz: {name}", 3, *messages)
    def _(bench: Bench) -> list[object]:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("values.npy", values)
            file.writestr("document.npy", document or npy(np.array(json.dumps(GOOD))))
        return bench.animate(None, "--units", bench.file("units.npz", content.getvalue()))


NO_MOTION = ("damaged, or no such file", "export it again")
_npz("a trillion frames declared", declared("(1000000000000, 1)"), *NO_MOTION, "in 0 bytes, required 8000000000000")
_npz("pickled objects", npy(np.array([{}], object)), *NO_MOTION)
_npz("texts", npy(np.array([["a"], ["b"]])), "values of <U1, required numbers")
_npz("a document that is none", npy(np.zeros((2, 1))), *NO_MOTION, document=npy(np.array("{")))


case(GROUP, "a recording as units", 3, "is a recording, required a units file")(
    lambda bench: bench.animate(None, "--units", bench.speech)
)


def _compared(name: str, content: str, *messages: str) -> None:
    @case(GROUP, f"compare: {name}", 3, *messages)
    def _(bench: Bench) -> list[object]:
        reference = bench.file("reference.json", json.dumps(GOOD | {"values": [[0.1]] * 8}))
        return ["compare", reference, bench.file("other.csv", content), "-o", "a.json"]


_compared("an empty file", "", "not a table of numbers")
_compared("no common channel", "time_s,jawOpen\n" + "".join(f"{n / 10},0\n" for n in range(8)),
          "it has jawOpen (weight), required one of opening (eye_distance)")  # fmt: skip
_compared("a motion of two frames", "time_s,opening\n0,0\n0.01,0\n", "2 common frames, required 4 or more")
_compared("NaN among the values", "time_s,opening\n0,0\n0.01,nan\n", "other.csv: ")
