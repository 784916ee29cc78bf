"""Whole batches: outputs as of ``animate``, failures among them, kept lines, processes that die, a cluster."""

import csv
import json
import os
import shutil
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from children import LIPMOTION, NOWHERE, Child, child, run_child, wait_until
from lipmotion import Delivery, Job, Outputs, Request, Run, animate, load_model, save_model, train, write
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, ExportError, InputError
from lipmotion.formats import list_suffixes
from lipmotion.pipeline.batch import BatchLine, batch, read_lines
from lipmotion.pipeline.batch import run as run_module
from lipmotion.pipeline.batch.ledger import Place
from lipmotion.pipeline.workers import WorkerDiedError
from lipmotion.types import Item
from testing.toy import SMALL


@pytest.fixture
def sounds(tmp_path: Path, toy_speech: Path) -> Path:
    folder = tmp_path / "sounds"
    for name in ("one.wav", "deep/two.wav", "three.wav"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(toy_speech, folder / name)
    (folder / "one.txt").write_text("see papa mama")
    return folder


@pytest.fixture
def settings(toy_model_file: Path) -> Job:
    return Job(Request(model=toy_model_file, recogniser="own"))


def ledger_rows(out: Path) -> list[dict]:
    return [json.loads(row) for row in (out / "batch.jsonl").read_bytes().splitlines()]


def contents(out: Path) -> dict[str, bytes]:
    reports = ("report.csv", "report.html", "batch.jsonl")
    files = [path for path in out.rglob("*") if path.is_file() and path.name not in reports]
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in files}


@pytest.mark.long
def test_the_outputs_are_those_of_animate(sounds, settings, tmp_path):
    (sounds / "broken.wav").write_text("no sound")
    events: list[Item] = []
    out = tmp_path / "out"
    settings = replace(settings, outputs=Outputs(kinds=("json", "cues.tsv", "TextGrid")))
    found = batch(sounds, out, settings, jobs=1, monitor=lambda e: events.append(e) if isinstance(e, Item) else None)
    assert (found.done, found.kept, found.failed) == (3, 0, 1)
    outcomes = dict.fromkeys(("one", "deep/two", "three"), "done")
    assert {item.name: item.outcome for item in events} == {"broken": "failed", **outcomes}
    assert set(contents(out)) == {f"{name}.{kind}" for name in outcomes for kind in settings.outputs.kinds}
    model = load_model(settings.request.model)
    alone = animate(Request(sounds / "one.wav", "see papa mama", recogniser="own"), model=model)
    write(alone, tmp_path / "one.json", speech=sounds / "one.wav", model=model)
    assert (out / "one.json").read_bytes() == (tmp_path / "one.json").read_bytes()
    rows = {row["name"]: row for row in ledger_rows(out)}
    assert rows["one"]["words"] == "transcript"
    assert rows["three"]["words"] != "transcript"
    assert "is text, required a recording" in rows["broken"]["error"]
    assert rows["one"]["closures_heard"] >= rows["one"]["closures_made"] >= 1


def test_what_was_done_is_kept(sounds, settings, tmp_path):
    out = tmp_path / "out"
    batch(sounds, out, settings, jobs=1)
    before = {name: (out / name).stat().st_mtime_ns for name in contents(out)}
    assert batch(sounds, out, settings, jobs=1).text == "3 lines: 0 done, 3 kept, 0 failed"
    (out / "three.json").unlink()
    (sounds / "one.txt").write_text("see mama")
    found = batch(sounds, out, settings, jobs=1)
    assert (found.done, found.kept) == (2, 1)
    changed = {name for name, time in before.items() if (out / name).stat().st_mtime_ns != time}
    assert changed == {"one.json", "three.json"}
    assert Counter(row["name"] for row in ledger_rows(out)) == {"one": 2, "three": 2, "deep/two": 1}
    assert batch(sounds, out, replace(settings, outputs=Outputs(kinds=("csv",))), jobs=1).done == 3


@pytest.mark.long
def test_marks_hold_in_every_run(sounds, settings, tmp_path, caplog):
    out, marks = tmp_path / "out", tmp_path / "marked.csv"
    batch(sounds, out, settings, jobs=1)
    for name in ("one", "three"):
        (out / f"{name}.json").write_text("by hand")
    marks.write_text("name;mark\none;approve\nthree;redo\nnobody;redo\n")
    assert batch(sounds, out, settings, jobs=1, marks=marks).text == "3 lines: 1 done, 2 kept, 0 failed"
    assert "1 marks of lines that are not in this batch: nobody" in caplog.text
    assert (out / "one.json").read_text() == "by hand"
    assert (out / "three.json").read_text() != "by hand"
    assert batch(sounds, out, settings, jobs=1).kept == 3
    (sounds / "one.txt").write_text("see mama")
    other = replace(settings, outputs=Outputs(rate_hz=50.0))
    assert batch(sounds, out, other, jobs=1).text == "3 lines: 2 done, 1 kept, 0 failed"
    assert (out / "one.json").read_text() == "by hand"
    assert "1 approved lines have another recording or other words now" in caplog.text
    with (out / "report.csv").open() as file:
        assert {row["name"]: row["mark"] for row in csv.DictReader(file)} == {
            "one": "approve", "three": "", "deep/two": "",
        }  # fmt: skip
    marks.write_text("name,mark\none,\n")
    assert batch(sounds, out, other, jobs=1, marks=marks).done == 1


def test_inputs_are_never_outputs(sounds, settings):
    with pytest.raises(ExportError, match="lies in the list or folder of recordings"):
        batch(sounds, sounds / "out", settings, jobs=1)
    with pytest.raises(ExportError, match="holds the recording"):
        batch([BatchLine("a", str(sounds / "one.wav"))], sounds, settings, jobs=1)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"outputs": Outputs(kinds=("cues.tsv",), fps=120.0)}, "frame rate is 120"),
        ({"outputs": Outputs(channels=("nope",))}, "nope"),
        ({"outputs": Outputs(kinds=("wav",))}, "required some of"),
        ({"outputs": Outputs(kinds=("mp4",)), "delivery": Delivery(offset_ms=50)}, "a video has its own sound"),
        ({"request": Request(model=Path("missing.lipmotion"))}, "no such model"),
        ({"request": Request(speaker="nobody")}, "nobody"),
        ({"request": Request(Path("one.wav"))}, "the job of a batch has 'recording', which belongs to one recording"),
        ({"outputs": Outputs(("one.json",))}, "the job of a batch has 'files'"),
        ({"jobs": 0}, "processes, required 1 or more"),
    ],
)
def test_what_no_line_could_do_ends_it_before_the_first_line(sounds, settings, tmp_path, wrong, message):
    jobs = wrong.get("jobs", 1)
    with pytest.raises((InputError, ExportError), match=message):
        batch(sounds, tmp_path / "out", replace(settings, **{k: v for k, v in wrong.items() if k != "jobs"}), jobs=jobs)
    assert not (tmp_path / "out").exists()


def test_silence_can_have_every_form_that_speech_can(settings):
    kinds = tuple(suffix.removeprefix(".") for suffix in list_suffixes())
    late = Delivery(offset_ms=-5000, stepped=True)
    run_module.check_line_job(
        replace(settings, outputs=Outputs(kinds=kinds, articulation=True), delivery=late), "first"
    )
    run_module.check_line_job(replace(settings, outputs=Outputs(curves="face", rate_hz=30.0)), "second")


@pytest.mark.long
def test_files_that_refer_to_the_sound(sounds, settings, tmp_path):
    """The outputs are written under other names first; what they refer to is found from where they end."""
    out = tmp_path / "out"
    lines = [BatchLine("deep/two", str(sounds / "deep/two.wav"))]
    batch(lines, out, replace(settings, outputs=Outputs(kinds=("usda",))), jobs=1)
    assert "@../../sounds/deep/two.wav@" in (out / "deep/two.usda").read_text()
    assert [path.name for path in (out / "deep").iterdir()] == ["two.usda"]


class DyingPool:
    """A pool whose worker dies at one line, every time or once."""

    def __init__(self, deadly: str, times: int) -> None:
        self.deadly, self.times = deadly, times

    def __call__(self, function, items):
        for item in items:
            if item.line.name == self.deadly and self.times:
                self.times -= 1
                item.place.work(item.line.name).mkdir(parents=True, exist_ok=True)
                raise WorkerDiedError("killed")
            yield function(item)


def waiting(sounds: Path, settings: Job, out: Path) -> list[run_module.LineWork]:
    place = Place(str(out), "run")
    for name in ("receipts", "work"):
        (place.own / name).mkdir(parents=True)
    (place.own / "run").write_text("run")
    return [run_module.LineWork(line, settings, "s", place) for line in read_lines(sounds, ("json",))]


@pytest.mark.parametrize(("times", "outcome"), [(1, "done"), (2, "failed")])
def test_a_worker_dies(sounds, settings, tmp_path, times, outcome):
    works = waiting(sounds, settings, tmp_path / "out")
    records = list(run_module._finish_lines(DyingPool("one", times), works))
    assert {record["name"]: record["outcome"] for record in records} == {
        "one": outcome, "three": "done", "deep/two": "done",
    }  # fmt: skip
    assert len(records) == 3


def test_workers_that_never_begin_end_the_batch(sounds, settings, tmp_path):
    def dead(*_):
        raise WorkerDiedError("no memory")

    with pytest.raises(CorpusError, match="die before they begin"):
        list(run_module._finish_lines(dead, waiting(sounds, settings, tmp_path / "out")))


def test_a_line_that_another_worker_finished_is_not_done_again(sounds, settings, tmp_path):
    work = waiting(sounds, settings, tmp_path / "out")[0]
    first = run_module.finish_line(work)
    assert 0 < first["motion"] < 1
    assert 0 <= first["least_sure_s"] < first["duration_s"]
    path = tmp_path / "out" / next(iter(first["outputs"]))
    before = path.stat().st_mtime_ns
    assert run_module.finish_line(work) == first
    assert path.stat().st_mtime_ns == before
    path.unlink()  # the worker died after the receipt, before the renaming
    assert run_module.finish_line(work)["outputs"] == first["outputs"]
    assert path.is_file()


def test_a_worker_of_an_earlier_run_writes_nothing(sounds, settings, tmp_path):
    work = waiting(sounds, settings, tmp_path / "out")[0]
    (work.place.own / "run").write_text("a later one")
    with pytest.raises(ExportError, match="another run of this batch has begun"):
        run_module.finish_line(work)
    assert contents(tmp_path / "out").keys() == {".batch/run"}


def test_an_output_that_cannot_be_written_is_a_line_that_fails(sounds, settings, tmp_path):
    out = tmp_path / "out"
    (out / "one.json").mkdir(parents=True)
    (out / "deep").touch()
    found = batch(sounds, out, settings, jobs=1)
    assert (found.done, found.failed) == (1, 2)
    rows = {row["name"]: row for row in ledger_rows(out)}
    assert "is a folder" in rows["one"]["error"]
    assert rows["deep/two"]["outcome"] == "failed"
    assert (out / "three.json").is_file()
    assert sorted(path.name for path in out.iterdir() if path.name.startswith(".")) == []


def test_a_bug_that_one_line_meets_does_not_end_the_batch(sounds, settings, tmp_path, monkeypatch):
    def broken(*_: object) -> None:
        raise ZeroDivisionError("float division")

    monkeypatch.setattr("lipmotion.pipeline.batch.run._write_line", broken)
    found = batch(sounds, tmp_path / "out", settings, jobs=1)
    assert found.failed == 3
    assert "unexpected ZeroDivisionError: float division" in ledger_rows(tmp_path / "out")[0]["error"]


@pytest.mark.skipif(sys.platform == "win32", reason="devices, pipes and links as POSIX has them")
def test_lines_that_would_wait_or_lead_elsewhere_fail_and_the_others_go_on(toy_speech, settings, tmp_path):
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (out / "deep").mkdir(parents=True)
    (out / "linked").symlink_to(elsewhere)
    (out / "deep" / "inside").symlink_to(out)
    (out / "two.json").symlink_to(elsewhere / "kept.json")
    (elsewhere / "kept.json").write_text("precious")
    os.mkfifo(tmp_path / "pipe.wav")
    (tmp_path / "to a pipe.wav").symlink_to(tmp_path / "pipe.wav")
    (tmp_path / "empty.wav").touch()
    sounds = {
        "zero": "/dev/zero", "pipe": "pipe.wav", "link": "to a pipe.wav", "folder": ".", "empty": "empty.wav",
        "nothing": "nothing.wav", "linked/one": toy_speech, "deep/inside/one": toy_speech, "two": toy_speech,
    }  # fmt: skip
    table = tmp_path / "lines.csv"
    table.write_text("file,output\n" + "".join(f"{sound},{name}\n" for name, sound in sounds.items()))
    found = batch(table, out, settings, jobs=1)
    said = {row["name"]: row.get("error", "") for row in ledger_rows(out)}
    assert (found.done, found.failed) == (1, 8)
    for name, words in {
        **dict.fromkeys(("zero", "pipe", "link"), "is a pipe or a device, required a file; save the recording first"),
        **{"folder": "is a folder; give one recording", "empty": "the file is empty", "nothing": "no such file"},
        **dict.fromkeys(("linked/one", "deep/inside/one"), "is a link, required a folder"),
    }.items():
        assert words in said[name], (name, said[name])
    assert {path.name: path.read_text() for path in elsewhere.iterdir()} == {"kept.json": "precious"}
    assert not (out / "two.json").is_symlink()  # replaced, not what it points to


def test_what_a_killed_process_was_writing_is_deleted(sounds, settings, tmp_path):
    """A process that ends within a write leaves a file of a name that no other run would write to."""
    out = tmp_path / "out"
    (out / "deep").mkdir(parents=True)
    staged = Place(str(out), "of an earlier run").staged("deep/two", "json")
    write = (
        "import os, sys; from pathlib import Path; from lipmotion.storage.files import atomic_file\n"
        "with atomic_file(Path(sys.argv[1])) as path:\n    path.write_text('half'); os._exit(9)"
    )
    assert run_child([sys.executable, "-c", write, staged]).returncode == 9
    assert len(list((out / "deep").iterdir())) == 1
    batch(sounds, out, settings, jobs=1)
    assert set(contents(out)) == {"one.json", "three.json", "deep/two.json"}


def command(*words: object) -> list[str]:
    return [*LIPMOTION, "batch", *map(str, words), "--machine-readable"]


LINES, BEFORE = 24, 4


@pytest.fixture(scope="module")
def many(
    tmp_path_factory: pytest.TempPathFactory, toy_speech: Path, toy_model_file: Path
) -> tuple[Path, dict[str, bytes]]:
    """A folder of recordings, and the outputs as one process writes them."""
    folder = tmp_path_factory.mktemp("many")
    (folder / "sounds").mkdir()
    for number in range(LINES):
        shutil.copy(toy_speech, folder / "sounds" / f"line{number:03}.wav")
    batch(folder / "sounds", folder / "out", Job(Request(model=toy_model_file, recogniser="own")), jobs=1)
    return folder / "sounds", contents(folder / "out")


def after_items(process: Child, act: Callable[[], None]) -> None:
    """Wait for the process to end; act when the first lines are done."""
    items = 0
    for event in map(json.loads, process.stdout):
        items += event["type"] == "item"
        if items == BEFORE and event["type"] == "item":
            act()
    process.wait()


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("whom", ["first process", "a worker"])
def test_kills(many, settings, tmp_path, whom):
    """The same command again gives the same files, each written once; a worker's death alone changes nothing."""
    sounds, wanted = many
    how = [sounds, "--out", tmp_path / "out", "--model", settings.request.model, "--recogniser", "own", "--jobs", 2]
    with child(command(*how)) as process:
        killed = lambda: process.pid if whom == "first process" else worker_of(process.pid)  # noqa: E731
        after_items(process, lambda: os.kill(killed(), signal.SIGKILL))
    if whom == "first process":
        assert process.returncode == -signal.SIGKILL
        assert run_child(command(*how)).returncode == 0
    assert contents(tmp_path / "out") == wanted
    names = Counter(row["name"] for row in ledger_rows(tmp_path / "out"))
    assert (len(names), max(names.values())) == (LINES, 1)


def worker_of(process: int) -> int:
    listed = run_child(["ps", "-o", "pid=,args=", "--ppid", process], check=True)
    rows = [row.split(maxsplit=1) for row in listed.stdout.splitlines()]
    return next(int(pid) for pid, words in rows if "resource_tracker" not in words)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[Child]]]:
    """A scheduler and two workers of Dask, each a process of its own."""
    pytest.importorskip("distributed")
    where = tmp_path / "scheduler.json"
    base = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(where), "--nthreads", "1"]
    worker += ["--no-dashboard", "--no-nanny", "--local-directory", str(tmp_path)]
    options = ["--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(where)]
    with ExitStack() as all_of_them:

        def start(words: list[str]) -> Child:
            return all_of_them.enter_context(child(words, stdout=NOWHERE, stderr=NOWHERE, folder=tmp_path))

        processes = [start([*base, *options])]
        processes += [start(worker) for _ in range(2)]
        from distributed import Client

        wait_until(lambda: where.is_file() and where.read_text())
        address = json.loads(where.read_text())["address"]
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        yield address, processes


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.filterwarnings("ignore")
def test_a_worker_of_a_cluster_is_killed(cluster, many, settings, tmp_path):
    """Nothing is lost, and nothing is done twice."""
    (address, processes), (sounds, wanted), model = cluster, many, settings.request.model
    how = [sounds, "--out", tmp_path / "out", "--model", model, "--recogniser", "own", "--cluster", address]
    with child(command(*how)) as process:
        after_items(process, processes[1].kill)
    assert process.returncode == 0
    assert contents(tmp_path / "out") == wanted
    names = Counter(row["name"] for row in ledger_rows(tmp_path / "out"))
    assert (len(names), max(names.values())) == (LINES, 1)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        batch(sounds, tmp_path / "other", settings, cluster="tcp://127.0.0.1:9")


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.filterwarnings("ignore")
def test_a_training_on_a_cluster_is_that_of_one_process(cluster, toy_corpus, tmp_path):
    """Also where a worker dies on the way."""
    address, processes = cluster
    how = {"engine": engine_named("joint", {}), "recogniser": replace(SMALL, iterations=1)}

    def kill_one(event: object) -> None:
        if getattr(event, "stage", "").endswith("contexts"):
            processes[1].kill()

    for name, run in (("one", Run()), ("other", Run(kill_one, workers=address))):
        save_model(train(toy_corpus, **how, run=run)[0], tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()
