"""Jobs, edits, projects, studies and answers, votes, and what is stored of training: all that people may write."""

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory

from fuzz.inputs import Files, Good
from fuzz.plausible import require
from lipmotion import Edits, Job, Request
from lipmotion.errors import InputError, LipMotionError
from lipmotion.pipeline.edit_files import EditFile, read_edits, write_edits
from lipmotion.pipeline.job import check_outputs, open_face
from lipmotion.storage.json_text import from_json
from lipmotion.types import Outlook, Span, Timeline, Unit
from lipmotion_studio.folder import PROJECT, VOTES, ProjectFolder
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
from lipmotion_studio.votes import read_votes
from pipeline.session.test_session import SENTENCES
from study.small_study import small_study

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


def seeds(_: Good) -> list[Files]:
    """Return a file of every kind, of JSON and of TOML or a table where there is one."""
    phones = Timeline((Span(0.0, 0.3, Unit("sil")), Span(0.3, 0.45, Unit("m", "m", "mama", 0.5))))
    outlook = Outlook("words", 0.66, 0.0, 31.2, ("the words that are spoken",))
    edits = EditFile(
        Edits().then(*SENTENCES), Request(Path("a.wav")), phones, outlook, Edits().then("hold from 1 to 2").steps
    )
    exported = ExportRecord("film", {"exports/a.mp4": DIGEST}, "exports/a.edits.json", DIGEST, DIGEST, "1.0")
    recording = ProjectRecording(1, "a", "sounds/a.wav", DIGEST, "hi", 1.5, 0.25, "approved", DIGEST, (exported,))
    recording = replace(recording, versions=(EditVersion(1, SENTENCES),))
    project = Project(model="voices/a.lipmotion", characters={"a": "b.glb"}, recordings="r")
    project = project.with_recordings([recording])
    side = {"name": "a", "model": DIGEST, "edits": DIGEST}
    votes = [{"line": "a", "shown": [side, side | {"name": "b", "model": ""}], "better": 1}]
    votes.append({"line": "a", "shown": ["x", "y"], "better": "x", "edits": DIGEST})
    answers = "r1,mos,0,hi,natural,a,,4,3.5,1,0,\n"
    found = {"job.json": json.dumps(JOB), PROJECT: json.dumps(describe_project(project)), VOTES: json.dumps(votes)}
    found |= {"job.toml": "".join(f"[{name}]\n{_toml(table)}" for name, table in JOB.items())}
    found |= {TRAINING: json.dumps({"format": "lipmotion.training", "version": 1, "made": [TRAINED], **TRAINED})}
    found |= {"answers.csv": ",".join(COLUMNS) + "\n" + answers}
    with TemporaryDirectory() as made:
        folder = Path(made) / "study"
        small_study(folder)
        found[MANIFEST] = (folder / MANIFEST).read_text(encoding="utf-8")
        for name in ("edits.json", "edits.toml"):
            write_edits(edits, folder / name)
            found[name] = (folder / name).read_text(encoding="utf-8")
    return [{name: text.encode()} for name, text in found.items()]


def _toml(table: dict[str, object]) -> str:
    return "".join(f"{name} = {json.dumps(value)}\n" for name, value in table.items())


def read(folder: Path, _: Good) -> None:
    """Read each file by its name; what was read can be written, and is then read as the same."""
    for path in [each for each in folder.rglob("*") if each.is_file()]:
        _read_one(path, path.relative_to(folder).as_posix(), folder)


def _job(path: Path) -> Job:
    """Return the job of an object of JSON, in which every value is put into every place."""
    try:
        content = from_json(path.read_bytes())
    except ValueError as error:
        raise InputError(str(error)) from error
    return Job.parsed(content if isinstance(content, dict) else {}).at(path.parent)


def _read_one(path: Path, name: str, folder: Path) -> None:
    if name == MANIFEST:
        read_study(folder)
    elif name == VOTES:
        read_votes(path)
    elif name == TRAINING:
        with TemporaryDirectory() as own:  # a good copy is put beside the file
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
        job = Job.from_file(path) if path.suffix == ".toml" else _job(path)
        check_outputs(replace(job, outputs=replace(job.outputs, files=("a.csv",))), open_face(job.outputs))
    else:
        file = read_edits(path)
        with TemporaryDirectory() as kept:
            write_edits(file, Path(kept) / "a.json")
            require(read_edits(Path(kept) / "a.json").edits == file.edits, "other edits")
        with suppress(LipMotionError):
            file.edits.delivery()
            file.edits.staging()
