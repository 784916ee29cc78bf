import gzip
import io
import os
import sys
import zipfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from children import PIPE, child, run_child
from lipmotion.errors import ExportError, InputError
from lipmotion.storage import files, locks
from lipmotion.storage.locks import LOCK, keep_unfinished, lock_folder
from lipmotion.storage.sources import Source, check_apart, check_kind

Context = Callable[[Path], AbstractContextManager[Path]]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_it_is_whole_and_an_old_one_stays_until_then(tmp_path: Path) -> None:
    target = tmp_path / "motion.json"
    for old, new in ((None, "first"), ("first", "second")):
        with files.atomic_file(target) as unfinished:
            unfinished.write_text(new)
            assert (target.read_text() if target.exists() else None) == old
            assert unfinished.suffix == target.suffix
            assert unfinished.parent == target.parent
        assert target.read_text() == new
        with pytest.raises(RuntimeError):
            fail(files.atomic_file(target), RuntimeError())
        assert target.read_text() == new
        assert names(tmp_path) == ["motion.json"]


def fail(context: AbstractContextManager[Path], error: BaseException) -> None:
    """Write a part of the content, then fail."""
    with context as unfinished:
        (unfinished / "entry.json" if unfinished.is_dir() else unfinished).write_text("half")
        raise error


@pytest.mark.parametrize("context", [files.atomic_file, files.replace_folder])
def test_a_failure_leaves_nothing(tmp_path: Path, context: Context) -> None:
    for error in (RuntimeError(), KeyboardInterrupt()):
        with pytest.raises(type(error)):
            fail(context(tmp_path / "one"), error)
    with pytest.raises(ExportError, match=r"one: cannot be written: No space left"):
        fail(context(tmp_path / "one"), OSError(28, "No space left on device"))
    with pytest.raises(ExportError, match=r"missing does not exist; create it first"):
        fail(context(tmp_path / "missing" / "a.json"), AssertionError())
    assert names(tmp_path) == []


def test_a_folder_appears_when_it_is_whole(tmp_path: Path) -> None:
    with files.replace_folder(tmp_path / "one") as unfinished:
        (unfinished / "entry.json").touch()
        assert not (tmp_path / "one").exists()
    assert names(tmp_path / "one") == ["entry.json"]
    assert names(tmp_path) == ["one"]


def test_a_folder_does_not_replace_one_that_holds_something(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "precious").touch()
    with pytest.raises(ExportError, match="one: cannot be written"), files.replace_folder(tmp_path / "one"):
        pass
    assert names(tmp_path) == ["one"]
    assert names(tmp_path / "one") == ["precious"]


def test_targets_are_checked_before_work_begins(tmp_path: Path) -> None:
    files.check_target(tmp_path / "new.json")
    (tmp_path / "file").touch()
    for target, words in (
        (tmp_path, r"is a folder; give the name of a file"),
        (tmp_path / "missing" / "new.json", r"the folder .*missing does not exist; create it first"),
        (tmp_path / "file" / "new.json", r"does not exist"),
    ):
        with pytest.raises(ExportError, match=words):
            files.check_target(target)
    assert names(tmp_path) == ["file"]


def test_what_a_killed_process_left_of_a_target_is_removed_with_the_next(tmp_path: Path) -> None:
    target = tmp_path / "motion.json"
    program = (
        "import os, pathlib, sys\n"
        "from lipmotion.storage.files import atomic_file\n"
        "with atomic_file(pathlib.Path(sys.argv[1])) as unfinished:\n"
        "    unfinished.write_text('half')\n"
        "    os._exit(1)\n"
    )
    run_child([sys.executable, "-c", program, target])
    (left,) = tmp_path.iterdir()
    os.utime(left, (0, 0))  # Windows, where no process can be looked for, goes by its age
    with files.atomic_file(tmp_path / "other.json") as other, files.atomic_file(target) as mine:
        assert len(names(tmp_path)) == 0
        other.touch()
        mine.touch()
        with files.atomic_file(target) as same:  # the file of a running process is not removed
            same.touch()
        assert mine.exists()
    assert names(tmp_path) == ["motion.json", "other.json"]


HOLD = (
    "import pathlib, sys\n"
    "from lipmotion.storage.locks import lock_folder\n"
    "with lock_folder(pathlib.Path(sys.argv[1])):\n"
    "    print('held', flush=True)\n"
    "    sys.stdin.read()\n"
)


def test_a_folder_is_held_by_one_process_and_let_go_of_when_it_is_killed(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "work"
    with child([sys.executable, "-c", HOLD, folder], stdin=PIPE) as process:
        assert process.stdout.readline() == "held\n"
        with pytest.raises(ExportError, match=rf"work: another lipmotion \(process {process.pid}\) is at work on it"):
            lock_folder(folder).__enter__()
        process.kill()
        process.wait()
    assert names(folder) == [LOCK]  # the file stays, but is not locked
    with lock_folder(folder):
        assert (folder / LOCK).read_text() == str(os.getpid())
    assert names(folder) == []


def test_finished_work_leaves_no_folder(tmp_path: Path) -> None:
    with keep_unfinished(tmp_path / "model") as folder:
        (folder / "stage").touch()
        assert names(tmp_path) == ["model.unfinished"]
    assert names(tmp_path) == []
    with pytest.raises(RuntimeError), keep_unfinished(tmp_path / "model"):  # nor does work without a result
        raise RuntimeError
    assert names(tmp_path) == []
    with pytest.raises(ExportError, match="does not exist"), keep_unfinished(tmp_path / "missing" / "model"):
        raise AssertionError


def test_unfinished_work_is_found_again(tmp_path: Path) -> None:
    def interrupted() -> None:
        with keep_unfinished(tmp_path / "model") as folder:
            (folder / "stage").touch()
            (folder / f"{files.TEMPORARY}half").touch()
            raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            interrupted()
    with keep_unfinished(tmp_path / "model") as folder:
        assert names(folder) == [LOCK, "stage"]


def test_a_link_is_written_through_and_unfinished_work_lies_beside_what_it_points_to(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    for name, target in (("a.json", "there/b.json"), ("c.json", "a.json")):
        (tmp_path / name).symlink_to(target)
    for name in ("c.json", "a.json"):
        with files.atomic_file(tmp_path / name) as unfinished:
            assert unfinished.parent == (tmp_path / "there").resolve()
            unfinished.write_text(name)
        assert (tmp_path / "there" / "b.json").read_text() == name
    assert names(tmp_path) == ["a.json", "c.json", "there"]
    assert names(tmp_path / "there") == ["b.json"]
    assert all((tmp_path / name).is_symlink() for name in ("a.json", "c.json"))
    (tmp_path / "m").symlink_to("there/model")
    with keep_unfinished(tmp_path / "m") as folder:
        assert folder == (tmp_path / "there").resolve() / "model.unfinished"
    assert names(tmp_path / "there") == ["b.json"]


def test_a_link_is_replaced_where_it_must_not_lead_away(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("old")
    (tmp_path / "corpus.json").symlink_to("precious")
    with files.confine(tmp_path), files.atomic_file(tmp_path / "corpus.json") as unfinished:
        unfinished.write_text("new")
    assert not (tmp_path / "corpus.json").is_symlink()
    assert (tmp_path / "precious").read_text() == "old"


def test_a_link_that_leads_nowhere(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "away").symlink_to("missing/b.json")
    for name, words in (("loop", "leads back to itself"), ("away", "the folder .*missing does not exist")):
        with pytest.raises(ExportError, match=words):
            files.check_target(tmp_path / name)
        with pytest.raises(ExportError, match=words), files.atomic_file(tmp_path / name):
            raise AssertionError
    assert names(tmp_path) == ["away", "loop"]


def test_two_outputs_that_are_one(tmp_path: Path) -> None:
    (tmp_path / "a").touch()
    (tmp_path / "soft").symlink_to("a")
    (tmp_path / "new").symlink_to("b")
    os.link(tmp_path / "a", tmp_path / "hard")
    for one, other in (("a", "soft"), ("hard", "a"), ("new", "b"), ("c", "../" + tmp_path.name + "/c")):
        with pytest.raises(ExportError, match="is given twice"):
            files.check_distinct([tmp_path / one, tmp_path / other])
    files.check_distinct([tmp_path / "a", tmp_path / "b", tmp_path / "c"])


def test_only_names_that_windows_does_not_take_get_other_ones() -> None:
    for name in (*"CON nul Aux.wav prn.tar.gz com1 LPT9.csv COM\u00b2 conin$ a.".split(), "NUL .txt", "a "):
        assert files.make_portable(name) != name
        assert files.make_portable(files.make_portable(name)) == files.make_portable(name)
    for name in "icon.wav console com10 lpt nul_.wav a.b .hidden null".split():
        assert files.make_portable(name) == name


def interrupted(folder: Path, step: int) -> bool:
    """Lock and release a folder with an interrupt at one step of it; return whether there were as many steps."""
    seen = 0

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal seen
        if frame.f_code.co_filename not in {files.__file__, locks.__file__}:
            return None
        seen += event == "line"
        if seen == step:
            seen += 1
            raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        with lock_folder(folder):
            pass
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def test_an_interrupt_at_any_step_leaves_no_lock(tmp_path: Path) -> None:
    step = 1
    while interrupted(tmp_path, step):
        assert names(tmp_path) == [], step
        step += 1
    assert step > 20


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A text, and a folder with a recording in it."""
    (tmp_path / "words.txt").write_text("words")
    (tmp_path / "folder" / "deep").mkdir(parents=True)
    (tmp_path / "folder" / "deep" / "a.wav").write_text("sound")
    return tmp_path


def test_a_file_is_known_whatever_its_name(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = place / "words.txt"
    (place / "soft").symlink_to(words)
    os.link(words, place / "hard")
    monkeypatch.chdir(place / "folder")
    for name in (words, place / "soft", place / "hard", Path("../words.txt"), Path("deep/../../folder/../words.txt")):
        for target, source in ((name, words), (words, name)):
            with pytest.raises(ExportError, match=r": is the transcript itself; give another name$"):
                check_apart([target], [Source(source, "transcript")])
            with pytest.raises(ExportError, match=r"give another name, or add --force to replace it$"):
                check_apart([target], [Source(source, "transcript", replaceable=True)])
            check_apart([target], [Source(source, "transcript", replaceable=True)], force=True)
            with pytest.raises(ExportError, match="is the transcript itself"):
                check_apart([target], [Source(source, "transcript")], force=True)


def test_nothing_is_written_into_a_folder_that_is_read(place: Path) -> None:
    folder = Source(place / "folder", "corpus", replaceable=True)
    (place / "way in").symlink_to(place / "folder")
    for name in ("folder/new.json", "folder/deep/a.wav", "folder/deep/new", "way in/new.json"):
        for force in (False, True):
            with pytest.raises(ExportError, match=r": lies in the corpus .*folder; give another name$"):
                check_apart([place / name], [folder], force=force)
            with pytest.raises(ExportError, match="lies in the corpus"):
                check_apart([], [folder], folders=[place / name], force=force)


def test_what_a_folder_links_to_belongs_to_it_and_a_link_into_it_leads_there(place: Path) -> None:
    corpus = [Source(place / "folder", "corpus")]
    (place / "elsewhere.wav").write_text("sound")
    check_apart([place / "elsewhere.wav"], corpus)
    (place / "folder" / "b.wav").symlink_to(place / "elsewhere.wav")
    with pytest.raises(ExportError, match=r"elsewhere\.wav: belongs to the corpus"):
        check_apart([place / "elsewhere.wav"], corpus)
    (place / "shortcut").symlink_to(place / "folder" / "deep")
    with pytest.raises(ExportError, match=r"lies in the corpus .*folder"):
        check_apart([place / "shortcut" / "new.json"], corpus)


def test_a_folder_that_is_written_holds_nothing_that_is_read(place: Path) -> None:
    for source in ("folder/deep", "folder/deep/a.wav"):
        with pytest.raises(ExportError, match="folder: holds the recording"):
            check_apart([], [Source(place / source, "recording")], folders=[place / "folder"])
    check_apart([place / "folder"], [Source(place / "folder" / "deep", "recording")])


def packed(*names: str, kind: str = "") -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for name, text in [("mimetype", kind)][not kind :] + [(name, "x" * 9000) for name in names]:
            file.writestr(name, text)
    return content.getvalue()


OLD_OFFICE = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(600)
FILES = {
    "a Word document": packed("[Content_Types].xml", "word/document.xml"), "old Office": OLD_OFFICE,
    "OpenDocument": packed("content.xml", kind="application/vnd.oasis.opendocument.text"),
    "Excel": packed("xl/workbook.xml"), "PDF": b"%PDF-1.7\n%\xe2\xe3", "RTF": b"{\\rtf1\\ansi",
    "Blender": b"BLENDER-v402REND", "a Blender file": gzip.compress(b"BLENDER_v279" + bytes(600)),
    "compressed": bytes.fromhex("28b52ffd0458"), "FBX": b"Kaydara FBX Binary  \0\x1a\0",
    "Maya": b"//Maya ASCII 2024 scene\n", "Photoshop": b"8BPS\0\x01",
    "Ableton": gzip.compress(b'<?xml version="1.0" encoding="UTF-8"?>\n<Ableton MajorVersion="5">' + bytes(9000)),
    "Audacity": b"SQLite format 3\0" + bytes(52) + b"AUDY" + bytes(28), "Reaper": b'<REAPER_PROJECT 0.1 "7.0"\n',
    "MIDI": b"MThd\0\0\0\x06", "web page": b"<!DOCTYPE html>\n<html>",
    "Git LFS": b"version https://git-lfs.github.com/spec/v1\n",
}  # fmt: skip
ELSEWHERE = {"a picture": b"\x89PNG\r\n\x1a\n", "archive": packed("take.wav"), "7z": b"7z\xbc\xaf\x27\x1c\0"}


@pytest.mark.parametrize("wanted", ["recording", "text", "motion file", "character"])
@pytest.mark.parametrize("name", FILES)
def test_it_is_named(name: str, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "take.wav"
    path.write_bytes(FILES[name])
    with pytest.raises(InputError, match=rf"take\.wav: is an? .*, required a {wanted}; ") as told:
        check_kind(path, wanted)
    assert name in str(told.value)


@pytest.mark.parametrize("wanted", ["recording", "text"])
def test_what_is_no_mistake_elsewhere(wanted: str, tmp_path: Path) -> None:
    for name, content in ELSEWHERE.items():
        (tmp_path / "take").write_bytes(content)
        with pytest.raises(InputError, match=f"required a {wanted}"):
            check_kind(tmp_path / "take", wanted)
        if name != "7z":
            check_kind(tmp_path / "take", "face")


def test_what_is_wanted_passes(tmp_path: Path) -> None:
    for wanted, content in (
        ("recording", b"RIFF\0\0\0\0WAVEfmt "), ("text", b"BLENDERS are loud. The blender of Maya is a PDF."),
        ("motion file", packed("values.npy")), ("character", b"glTF\2\0\0\0"), ("recording", b""),
    ):  # fmt: skip
        (tmp_path / "take").write_bytes(content)
        check_kind(tmp_path / "take", wanted)
    check_kind(tmp_path, "recording")
    check_kind(tmp_path / "missing", "recording")
    (tmp_path / "take").write_bytes(b"RIFF\0\0\0\0WAVEfmt ")
    for wanted in ("text", "motion file"):
        with pytest.raises(InputError, match="is a recording"):
            check_kind(tmp_path / "take", wanted)
