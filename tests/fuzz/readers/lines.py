"""Lists of recordings for ``batch``, and the ledger and the marks that an earlier batch left."""

import json
import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from fuzz.inputs import Files, Good
from fuzz.plausible import require
from lipmotion.pipeline.batch import BatchLine, read_lines
from lipmotion.pipeline.batch.ledger import LEDGER, Place, open_ledger, write_receipt
from lipmotion.pipeline.batch.report import MARKS, read_marks, write_marks, write_reports

TEXTS = {
    "list.txt": "a/one.wav\nb/two.flac\n\n../three, four.wav\n",
    "list.csv": 'file,transcript,output,speaker\none.wav,"Hello, you",act/one.json,anna\ntwo.wav,,,\n',
    "list.tsv": "path\ttranscript\none.wav\thello\n",
}
KINDS = ("json", "cues.json")
ROW = {
    **{"name": "one", "recording": "/sounds/one.wav", "run": "a", "fingerprint": "b", "outcome": "done"},
    "inputs": [{"path": "/sounds/one.wav", "size": 5, "changed_ns": 1_790_000_000_000_000_000, "sha256": "0a"}],
    "outputs": {"one.json": "0a", "one.cues.json": "0b"},
    **{"duration_s": 1.5, "seconds": 0.5, "words": "words", "confidence": 0.75, "voice": None, "range_db": 30.0},
    **{"closures_heard": 3, "closures_made": 2, "widest": 0.25, "warnings": ["=1+1"], "advice": []},
}
FAILED = {"outcome": "failed", "error": "no sound", "outputs": {}}


def seeds(_: Good) -> list[Files]:
    """Return small lists, and two with a ledger."""
    rows = [ROW, ROW | FAILED, ROW, ROW | {"name": "two", "outputs": {"two.json": "0c"}}]
    whole = "".join(json.dumps(row) + "\n" for row in rows).encode()
    lists = [{name: text.encode()} for name, text in TEXTS.items()]
    lists.append({"list.txt": b"one.wav\n", MARKS: b"name,mark,when\none,redo,12:30\n'=two,approve,\n"})
    return [*lists, *({"list.txt": b"one.wav\ntwo.wav\n", LEDGER: ledger} for ledger in (whole, whole[:700]))]


def read(folder: Path, _: Good) -> None:
    """Read a list; every output has a name of its own inside the folder of the outputs. Go on from a ledger."""
    ledger, listed = folder / LEDGER, [path for path in folder.iterdir() if path.name not in (LEDGER, MARKS)]
    lines = read_lines(listed[0], KINDS) if listed else [BatchLine("one", "/sounds/one.wav")]
    names = [line.name.casefold() for line in lines]
    require(len(set(names)) == len(names), "two lines with one name")
    require(not any(name.startswith("/") or ".." in name.split("/") for name in names), "an output outside its folder")
    if (folder / MARKS).is_file():
        marks = read_marks(folder / MARKS)
        with TemporaryDirectory() as out:
            write_marks(Path(out) / MARKS, marks)
            require(read_marks(Path(out) / MARKS) == marks, "marks that are not read as they were written")
    if ledger.is_file():
        with TemporaryDirectory() as out:
            shutil.copy(ledger, Path(out) / LEDGER)
            _go_on(Place(out, "run"), lines)


def _go_on(place: Place, lines: list[BatchLine]) -> None:
    """Open a ledger beside unfinished work and pipes, and write the reports of what it holds."""
    place.work("one").mkdir(parents=True)
    place.receipt("two").parent.mkdir()
    write_receipt(place.receipt("two"), ROW)
    if hasattr(os, "mkfifo"):
        os.mkfifo(place.receipt("one"))
    out = Path(place.out)
    with open_ledger(place, lines) as ledger:
        require(all(ledger.kept(line, "settings", out) is None for line in lines), "a line without outputs is kept")
        write_reports(lines, ledger, out)
    left = {path.name for path in out.iterdir()}
    require(left == {LEDGER, "report.csv", "report.html"}, f"left behind: {sorted(left)}")
