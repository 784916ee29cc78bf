"""Inputs of the fuzzer, the readers that are fuzzed, and what is plausible of their results."""

import json
import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion import Corpus, Model, load_model, write
from lipmotion.types import Audio, Generation, Motion
from lipmotion.types.motion import LARGEST_MAGNITUDE

Files = dict[str, bytes]  # one input: contents of files by name; a name may include folders


class ImplausibleError(AssertionError):
    """A reader accepted an input, but its result is implausible."""


@dataclass(frozen=True)
class Good:
    """A good corpus and good models, which readers of other inputs need.

    corpus : a prepared corpus
    models : trained on it; the first one is of the default engine
    """

    corpus: Path
    models: tuple[Path, ...]


@dataclass(frozen=True)
class Reader:
    """A reader of the package.

    seeds : returns good inputs
    read  : reads the files of a folder, and checks the result
    """

    name: str
    seeds: Callable[[Good], list[Files]]
    read: Callable[[Path, Good], None]


def digest(files: Files) -> bytes:
    found = sha256()
    for name, content in sorted(files.items()):
        found.update(f"{len(name)} {name} {len(content)} ".encode("utf-8", "surrogatepass") + content)
    return found.digest()


def lay_out(files: Files, folder: Path) -> None:
    """Write the files of an input into an empty folder."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def picked_up(folder: Path) -> Files:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


GENERATED = {"eye_distance": 10.0, "weight": 100.0, "grey": 1e6}
"""Largest plausible value of generated motion, by unit: a whole head is two eye distances high."""
LONGEST_S = 3600.0
SHORT = slice(6000, 18_000)  # samples of the toy sentence: its first word


def require(holds: bool, text: str) -> None:
    if not holds:
        raise ImplausibleError(text)


@cache
def short_speech(good: Good) -> Audio:
    corpus = Corpus.open(good.corpus)
    audio = corpus.utterance(corpus.names()[0]).audio
    return Audio(audio.samples[SHORT].copy(), audio.rate_hz)


@cache
def good_model(good: Good) -> Model:
    return load_model(good.models[0])


def check_motion(motion: Motion, largest_of: Mapping[str, float] = LARGEST_MAGNITUDE) -> None:
    """Raise ImplausibleError unless all values are finite and plausible in their units."""
    require(bool(np.isfinite(motion.values).all()), "values that are not finite")
    for channel, curve in zip(motion.channels, motion.values.T, strict=True):
        largest = float(np.abs(curve).max(initial=0.0))
        require(largest <= largest_of.get(channel.unit, math.inf), f"motion in {channel.unit} that is absurd")


def check_generation(result: Generation) -> None:
    """Raise ImplausibleError unless motion, variance and written files of a generation are plausible."""
    check_motion(result.motion, GENERATED)
    require(len(result.motion.values) <= LONGEST_S * result.motion.rate_hz, "hours of motion")
    require(bool((result.variance >= 0).all()), "a variance that is negative or none")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.json"
        write(result, [path])
        json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse_constant)


def refuse_constant(name: str) -> Any:
    raise ImplausibleError(f"{name} in what was written")
