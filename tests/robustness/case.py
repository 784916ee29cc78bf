"""Cases of bad input, and the good inputs from which they are made."""

import io
import json
import shutil
import wave
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Bench:
    """Good inputs, and a folder in which bad ones are written.

    folder   : beside the current folder, which a failing command must leave empty
    model    : of the default engine
    coupled  : a model of the coupled engine
    pictured : a model with eigenlips
    face     : of the drawn person
    """

    folder: Path
    speech: Path
    model: Path
    corpus: Path
    coupled: Path
    pictured: Path
    face: Path

    def file(self, name: str, content: bytes | str) -> Path:
        path = self.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    def samples(self) -> NDArray[np.float32]:
        with wave.open(str(self.speech)) as file:
            return np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(np.float32) / 32_768

    def sound(self, samples: NDArray[Any], rate_hz: int = 16_000) -> Path:
        """Write samples without conversion, floats or integers [shape=(N,) or (N, channels)]; return the file."""
        from scipy.io import wavfile

        path = self.folder / "sound.wav"
        wavfile.write(path, rate_hz, samples)
        return path

    def animate(self, speech: object = None, *more: object, output: object = "a.json") -> list[object]:
        """Return the command line of ``animate``, with good inputs by default."""
        model = [] if "--model" in more else ["--model", self.model]
        whose = [] if "--recogniser" in more else ["--recogniser", "own"]
        return ["animate", self.speech if speech is None else speech, *model, *whose, "-o", output, *more]

    def changed_model(self, changes: dict[str, bytes | None], of: Path | None = None, /, **header: object) -> Path:
        return changed_model(of or self.model, self.folder / "changed.lipmotion", changes, **header)

    def array(self, name: str, of: Path | None = None) -> NDArray[Any]:
        with zipfile.ZipFile(of or self.model) as file:
            array: NDArray[Any] = np.load(io.BytesIO(file.read(f"{name}.npy")), allow_pickle=False)
        return array.copy()

    def copied_corpus(self) -> Path:
        path = self.folder / "corpus"
        shutil.copytree(self.corpus, path)
        return path


def changed_model(source: Path, target: Path, changes: Mapping[str, bytes | None], **header: object) -> Path:
    """Copy a model with some members replaced, added, or (None) left out, or with another header; return the copy."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        members = {name: old.read(name) for name in old.namelist()} | changes
        if header:
            members["header.json"] = json.dumps(json.loads(members["header.json"] or "") | header).encode()
        for name, content in members.items():
            if content is not None:
                new.writestr(name, content)
    return target


def npy(array: NDArray[Any]) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def declared(shape: str, descr: str = "<f8", content: bytes = b"") -> bytes:
    """Return the content of an ``.npy`` file with any header."""
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + content


Make = Callable[[Bench], "list[object]"]


@dataclass(frozen=True)
class Case:
    """One bad input.

    group    : the group of cases that it belongs to
    name     : description of the defect
    code     : the exit code
    messages : parts of the error message, or of the warning where the code is 0
    make     : writes the input, and returns the command line
    """

    group: str
    name: str
    code: int
    messages: tuple[str, ...]
    make: Make


CASES: list[Case] = []


def case(group: str, name: str, code: int, *messages: str) -> Callable[[Make], Make]:
    """Return a decorator that adds a case to the table; the decorated function writes its input."""

    def keep(make: Make) -> Make:
        CASES.append(Case(group, name, code, messages, make))
        return make

    return keep


def _fill(row: dict[str, Any], bench: Bench) -> list[object]:
    """Write the files of a row; return its command line, with the paths of good inputs in place of their capitals."""
    known = {"SPEECH": bench.speech, "MODEL": bench.model, "COUPLED": bench.coupled, "PICTURED": bench.pictured}
    known |= {"CORPUS": bench.corpus, "FACE": bench.face, "FOLDER": bench.folder}
    for name, text in row.get("files", {}).items():
        bench.file(name, text)
    parted = (arg.partition("/") for arg in row["args"])
    return [known[first] / rest if first in known else first + slash + rest for first, slash, rest in parted]


ROWS = json.loads(Path(__file__).with_name("cases.json").read_text(encoding="utf-8"))
"""The cases of which command line and files are texts."""
for _row in ROWS:
    CASES.append(Case(_row["group"], _row["name"], _row["code"], tuple(_row["messages"]), partial(_fill, _row)))
