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


def _json(name: str, text: str | dict[str, object], code: int, *messages: str) -> None:
    content = text if isinstance(text, str) else json.dumps(GOOD | text)
    case(GROUP, f"json: {name}", code, *messages)(
        lambda bench: bench.animate(None, "--units", bench.file("units.json", content))
    )


_json("two million units", json.dumps(GOOD | {"units": []}).replace("[]", "[" + "0," * 2_000_000 + "0]"), 3, *DAMAGED,
      "a list of more than 1048576 items")  # fmt: skip
_json("100,000 brackets", '{"values": ' + "[" * 100_000, 3, "not JSON", "export it again")


def _npz(name: str, values: bytes, *messages: str, document: bytes | None = None) -> None:
    @case(GROUP, f"npz: {name}", 3, *messages)
    def _(bench: Bench) -> list[object]:
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("values.npy", values)
            file.writestr("document.npy", document or npy(np.array(json.dumps(GOOD))))
        return bench.animate(None, "--units", bench.file("units.npz", content.getvalue()))


NO_MOTION = ("damaged, or of another program", "export it again")
_npz("a trillion frames declared", declared("(1000000000000, 1)"), *NO_MOTION, "in 0 bytes, required 8000000000000")
_npz("pickled objects", npy(np.array([{}], object)), *NO_MOTION)
_npz("texts", npy(np.array([["a"], ["b"]])), "values of <U1, required numbers")
_npz("a document that is none", npy(np.zeros((2, 1))), *NO_MOTION, document=npy(np.array("{")))
