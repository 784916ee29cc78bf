"""What a case of bad input is, and what cases are made of."""

from __future__ import annotations

import io
import json
import shutil
import wave
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Bench:
    """Good input, and a folder for the bad.

    folder : beside the current one, which a command must leave empty
    coupled, pictured : models of another engine, and of eigenlips
    """

    folder: Path
    speech: Path
    model: Path
    corpus: Path
    coupled: Path
    pictured: Path

    def file(self, name: str, content: bytes | str) -> Path:
        path = self.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    def samples(self) -> NDArray[np.float32]:
        """Return the good sentence."""
        with wave.open(str(self.speech)) as file:
            return np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(np.float32) / 32_768

    def sound(self, samples: NDArray[Any], rate_hz: int = 16_000) -> Path:
        """Write samples as they are, float or whole [shape=(N,) or (N, channels)]."""
        from scipy.io import wavfile

        path = self.folder / "sound.wav"
        wavfile.write(path, rate_hz, samples)
        return path

    def animate(self, speech: object = None, *more: object, output: object = "a.json") -> list[object]:
        """Return a command line; what is not said is good."""
        model = [] if "--model" in more else ["--model", self.model]
        whose = [] if "--recogniser" in more else ["--recogniser", "own"]
        return ["animate", self.speech if speech is None else speech, *model, *whose, "-o", output, *more]

    def changed_model(self, changes: dict[str, bytes | None], of: Path | None = None, /, **header: object) -> Path:
        """Return a copy of a model with other members (None: without them), or another header."""
        path = self.folder / "changed.lipmotion"
        with zipfile.ZipFile(of or self.model) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
            for name in old.namelist():
                content = changes.get(name, old.read(name))
                if name == "header.json" and content is not None and header:
                    content = json.dumps(json.loads(content) | header).encode()
                if content is not None:
                    new.writestr(name, content)
            for name in changes.keys() - set(old.namelist()):
                new.writestr(name, changes[name] or b"")
        return path

    def array(self, name: str, of: Path | None = None) -> NDArray[Any]:
        """Return one array of a model."""
        with zipfile.ZipFile(of or self.model) as file:
            array: NDArray[Any] = np.load(io.BytesIO(file.read(f"{name}.npy")), allow_pickle=False)
        return array.copy()

    def copied_corpus(self) -> Path:
        """Return a copy of the corpus, to be damaged."""
        path = self.folder / "corpus"
        shutil.copytree(self.corpus, path)
        return path


def npy(array: NDArray[Any]) -> bytes:
    """Return an array as a file's content."""
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def declared(shape: str, descr: str = "<f8", content: bytes = b"") -> bytes:
    """Return an array's file whose header says what it likes."""
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + content


Make = Callable[[Bench], "list[object]"]


@dataclass(frozen=True)
class Case:
    """One bad input.

    group  : the class that it belongs to
    name   : what is bad, in words
    code   : the exit code
    says   : words of the message, or of the warning where the code is 0
    make   : lays it out, and returns the command line
    """

    group: str
    name: str
    code: int
    says: tuple[str, ...]
    make: Make


CASES: list[Case] = []


def case(group: str, name: str, code: int, *says: str) -> Callable[[Make], Make]:
    """Put what makes a bad input into the table."""

    def keep(make: Make) -> Make:
        CASES.append(Case(group, name, code, says, make))
        return make

    return keep
