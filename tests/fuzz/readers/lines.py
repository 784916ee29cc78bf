"""Lists of recordings for ``batch``."""

from __future__ import annotations

from pathlib import Path

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import require
from lipmotion.pipeline.batch import read_lines

TEXTS = {
    "list.txt": "a/one.wav\nb/two.flac\n\n../three, four.wav\n",
    "list.csv": 'file,transcript,output,speaker\none.wav,"Hello, you",act/one.json,anna\ntwo.wav,,,\n',
    "list.tsv": "path\ttranscript\none.wav\thello\n",
}


def seeds(_: Good) -> list[Files]:
    """Return small lists."""
    return [{name: text.encode()} for name, text in TEXTS.items()]


def read(folder: Path, _: Good) -> None:
    """Read a list; every output has a name of its own inside the folder of the outputs."""
    lines = read_lines(next(folder.iterdir()), ("json", "cues.json"))
    names = [line.name.casefold() for line in lines]
    require(len(set(names)) == len(names), "two lines with one name")
    require(not any(name.startswith("/") or ".." in name.split("/") for name in names), "an output outside its folder")
