"""Readers of what people and programs send: lists, jobs, edits, projects, studies, requests, live sound and replies."""

import copy
import json
import os
import shutil
import socket
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from websockets.sync.client import connect

from fuzz.inputs import Files, Good, Reader, require, short_speech
from lipmotion import Edits, Job, LiveFrame, Request, Stream
from lipmotion.errors import InputError, LipMotionError
from lipmotion.pipeline.batch import BatchLine, read_lines
from lipmotion.pipeline.batch.ledger import LEDGER, Place, open_ledger, write_receipt
from lipmotion.pipeline.batch.report import MARKS, read_marks, write_marks, write_reports
from lipmotion.pipeline.edit_files import EditFile, read_edits, write_edits
from lipmotion.pipeline.job import check_outputs, open_face
from lipmotion.storage.archive import take_array
from lipmotion.storage.json_text import from_json
from lipmotion.types import Outlook, Span, Timeline, Unit
from lipmotion_studio.folder import PROJECT, ProjectFolder
from lipmotion_studio.live import servers
from lipmotion_studio.project import (
    EditVersion,
    ExportRecord,
    Project,
    ProjectRecording,
    describe_project,
    parse_project,
)
from lipmotion_studio.study.answers import COLUMNS, read_answers
from lipmotion_studio.study.manifest import MANIFEST, read_study
from lipmotion_studio.trainer import Trainer
from pipeline.session.test_session import SENTENCES
from study.small_study import small_study

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


def seed_lines(_: Good) -> list[Files]:
    """Return small lists, and two with a ledger."""
    rows = [ROW, ROW | FAILED, ROW, ROW | {"name": "two", "outputs": {"two.json": "0c"}}]
    whole = "".join(json.dumps(row) + "\n" for row in rows).encode()
    lists = [{name: text.encode()} for name, text in TEXTS.items()]
    lists.append({"list.txt": b"one.wav\n", MARKS: b"name,mark,when\none,redo,12:30\n'=two,approve,\n"})
    return [*lists, *({"list.txt": b"one.wav\ntwo.wav\n", LEDGER: ledger} for ledger in (whole, whole[:700]))]


def check_lines(folder: Path, _: Good) -> None:
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
        require(all(ledger.find_same(line, "settings", out) is None for line in lines), "a line without output is kept")
        write_reports(lines, ledger, out)
    left = {path.name for path in out.iterdir()}
    require(left == {LEDGER, "report.csv", "report.html"}, f"left behind: {sorted(left)}")


TRAINING = "training/state.json"
JOB: dict[str, dict[str, object]] = {
    "request": {"recording": "a.wav", "recogniser": "fast", "asymmetry": 0.5, "transcript": "mama bites"},
    "outputs": {"files": ["w.csv"], "rate_hz": 25, "channels": ["opening"], "fps": 30.5, "face": "head"},
    "delivery": {"intensity": 1.2, "anticipation_ms": 20, "min_hold_ms": 10, "mood": "happy:0.7 at 1"},
    "staging": {"head": False, "size": 256, "seed": 4},
}
DIGEST = "0a" * 32
TRAINED = {
    "wanted": {"kind": "voice", "name": "anna", "lines": [1, 2], "options": {}},
    "told": {"state": "done", "share": 1.0, "warnings": ["a"], "skipped": [], "report": {"file": "a"}, "error": ""},
}


def seed_settings(_: Good) -> list[Files]:
    """Return a file of every kind, of JSON and of TOML or a table where there is one."""
    phones = Timeline((Span(0.0, 0.3, Unit("sil")), Span(0.3, 0.45, Unit("m", "m", "mama", 0.5))))
    outlook = Outlook("words", 0.66, 0.0, 31.2, ("the words that are spoken",))
    edits = EditFile(
        Edits().then(*SENTENCES["sentences"]),
        Request(Path("a.wav")),
        phones,
        outlook,
        Edits().then("hold from 1 to 2").steps,
    )
    exported = ExportRecord("film", {"exports/a.mp4": DIGEST}, "exports/a.edits.json", DIGEST, DIGEST, "1.0")
    recording = ProjectRecording(1, "a", "sounds/a.wav", DIGEST, "hi", 1.5, 0.25, "approved", DIGEST, (exported,))
    recording = replace(recording, versions=(EditVersion(1, tuple(SENTENCES["sentences"])),))
    project = Project(model="voices/a.lipmotion", characters={"a": "b.glb"}, recordings="r")
    project = project.with_recordings([recording])
    answers = "r1,mos,0,hi,natural,a,,4,3.5,1,0,\n"
    found = {"job.json": json.dumps(JOB), PROJECT: json.dumps(describe_project(project))}
    found |= {"job.toml": "".join(f"[{name}]\n{_toml(table)}" for name, table in JOB.items())}
    found |= {TRAINING: json.dumps({"format": "lipmotion.training", "version": 1, **TRAINED})}
    found |= {"answers.csv": ",".join(COLUMNS) + "\n" + answers}
    with TemporaryDirectory() as made:
        folder = Path(made) / "study"
        small_study(folder)
        found[MANIFEST] = (folder / MANIFEST).read_text(encoding="utf-8")
        write_edits(edits, folder / "edits.json")
        found["edits.json"] = (folder / "edits.json").read_text(encoding="utf-8")
    return [{name: text.encode()} for name, text in found.items()]


def _toml(table: dict[str, object]) -> str:
    return "".join(f"{name} = {json.dumps(value)}\n" for name, value in table.items())


def check_settings(folder: Path, _: Good) -> None:
    """Read each file by its name; what was read can be written, and is then read as the same."""
    for path in [each for each in folder.rglob("*") if each.is_file()]:
        _read_one(path, path.relative_to(folder).as_posix(), folder)


def _read_one(path: Path, name: str, folder: Path) -> None:
    if name == MANIFEST:
        read_study(folder)
    elif name == TRAINING:
        with TemporaryDirectory() as own:  # a damaged file gets another name
            (Path(own) / TRAINING).parent.mkdir()
            copyfile(path, Path(own) / TRAINING)
            Trainer(ProjectFolder(Path(own))).describe()
    elif name == PROJECT:
        project = ProjectFolder(folder).project
        require(parse_project(from_json(json.dumps(describe_project(project)))) == project, "another project")
        for line in project.lines.values():
            require(not ProjectFolder(folder).locate_edits(line).exists(), "edits that nobody wrote")
    elif name.startswith("answers"):
        read_answers(path)
    elif name.startswith("job"):
        if path.suffix == ".toml":
            job = Job.from_file(path)
        else:  # an object of JSON, in which every value is put into every place
            content = _decoded(from_json, path.read_bytes())
            job = Job.parsed(content if isinstance(content, dict) else {}).at(folder)
        check_outputs(replace(job, outputs=replace(job.outputs, files=("a.csv",))), open_face(job.outputs))
    else:
        file = read_edits(path)
        with TemporaryDirectory() as kept:
            write_edits(file, Path(kept) / "a.json")
            require(read_edits(Path(kept) / "a.json").edits == file.edits, "other edits")
        with suppress(LipMotionError):
            file.edits.delivery()
            file.edits.staging()


WORDS = [["baby", 0.1, 0.4], ["", 0.4, 0.5], ["<b>two</b>", 0.5, 0.9]]
UPGRADE = "upgrade: websocket\r\nconnection: Upgrade\r\nsec-websocket-version: 13\r\n"
REQUEST = f"GET / HTTP/1.1\r\nhost: localhost\r\n{UPGRADE}sec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
FRAME = b"\x81\x85\x01\x02\x03\x04" + bytes(a ^ b for a, b in zip(b"ready", b"\1\2\3\4\1", strict=True))


def seed_live(good: Good) -> list[Files]:
    sound = short_speech(good).samples[:4000]
    with tempfile.TemporaryDirectory() as folder:
        for name, samples in (("mono", sound), ("stereo", np.stack([sound, sound], axis=1).astype(np.float64))):
            np.save(Path(folder) / f"{name}.npy", samples)
        arrays = [{path.name: path.read_bytes()} for path in sorted(Path(folder).iterdir())]
    raw = (sound * 32767).astype("<i2").tobytes()
    texts = {"words.json": WORDS, "phones.json": [["b", 0.1, 0.2], ["ey1", 0.2, 0.4]]}
    found = [{name: json.dumps(content).encode()} for name, content in texts.items()]
    return [*found, *arrays, {"sound.raw": raw}, {"client.http": REQUEST.encode() + FRAME}]


def check_live(folder: Path, good: Good) -> None:
    """Move a mouth by the sound or the words; or talk to the server, which then still serves others."""
    (path,) = folder.iterdir()
    content = path.read_bytes()
    if path.suffix == ".http":
        _send(content)
    else:
        stream, frames = copy.deepcopy(_stream()), list[LiveFrame]()
        if path.suffix == ".json":
            (stream.add_words if path.stem == "words" else stream.add_phones)(_decoded(from_json, content))
        elif path.suffix == ".raw":
            frames = stream.push(content)
        else:
            array = _decoded(take_array, content)
            frames = stream.push(array if array.size < 1e6 else array.ravel()[:1_000_000])
        frames += stream.push(short_speech(good).samples[:8000]) + stream.flush()
        require([frame.number for frame in frames] == list(range(len(frames))), "frames that are missing")
        values = [value for frame in frames for value in (*frame.motion, *frame.weights.values())]
        require(bool(np.isfinite(values).all()), "a frame that is not finite")


def _decoded(decode: Callable[[bytes], Any], content: bytes) -> Any:
    """Return what a program sends that decodes its content first."""
    try:
        return decode(content)
    except ValueError as error:
        raise InputError(str(error)) from error


@cache
def _stream() -> Stream:
    return Stream(look_ahead_ms=80)


def _send(content: bytes) -> None:
    server = servers.Server("hello")
    with servers.open_server("websocket:127.0.0.1:0", 0, server):
        host, _, port = server.address.rpartition(":")
        with socket.create_connection((host, int(port)), timeout=5) as client, suppress(OSError):
            client.sendall(content)
            client.shutdown(socket.SHUT_WR)
            while client.recv(1 << 16):
                pass
        with connect(f"ws://{host}:{port}/", proxy=None) as other:
            require(other.recv(timeout=10) == "hello", "a server that no longer greets")


READERS = {
    "lines": Reader("lines", seed_lines, check_lines),
    "settings": Reader("settings", seed_settings, check_settings),
    "live": Reader("live", seed_live, check_live),
}
