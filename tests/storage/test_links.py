import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Corpus
from lipmotion.errors import ExportError, LipMotionError
from lipmotion.pipeline.batch.ledger import Place, open_ledger
from lipmotion.storage import files
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.locks import LOCK, keep_unfinished, lock_folder, open_temporary, remove_unfinished
from lipmotion_faces.corpus.sync import remove_offsets
from lipmotion_studio.folder import open_folder
from lipmotion_studio.study.manifest import MANIFEST
from lipmotion_studio.study.store import ANSWERS, StudyStore
from lipmotion_studio.training import VOICE, TrainingOrder, TrainingRecording, VoiceOptions, run_training
from testing.toy import toy_utterances

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="links as POSIX has them")
Verb = Callable[[Path], object]
LEFT = f"{files.TEMPORARY}left"


def outside_of(tmp_path: Path) -> Path:
    """Return a folder that belongs to somebody else, with whatever names the verbs may look for."""
    outside = tmp_path / "outside"
    (outside / "folder").mkdir(parents=True)
    for name in ("file", LEFT, "folder/file", "line.edits.json", "old.lipmotion.unfinished"):
        (outside / name).write_text("precious")
    (outside / "empty").touch()
    return outside


def content_of(folder: Path) -> dict[str, bytes | None]:
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def drop(folder: Path) -> None:
    with open_folder(None, folder) as project:
        (folder / "came").write_bytes(b"sound")
        project.drop("line.wav", folder / "came", "")


def pronounce(folder: Path) -> None:
    with open_folder(None, folder) as project:
        project.add_pronunciation("bob", ("b", "aa", "b"), project.compute_word_revision("bob"))


def train_voice(folder: Path) -> None:
    with open_folder(None, folder):
        (folder / "came.mp4").write_bytes(b"no video")
        lines = (TrainingRecording(folder / "came.mp4", "line", "words"),)
        place = folder / "voices" / "new.lipmotion"
        order = TrainingOrder(VOICE, place, folder / "training", lines, VoiceOptions(), None, 1)
    run_training(order, lambda _: None)


def add_to_corpus(folder: Path) -> None:
    Corpus.create(folder).add(toy_utterances(3)[0])


def sync_corpus(folder: Path) -> None:
    remove_offsets(Corpus.create(folder))


def begin_batch(folder: Path) -> None:
    with open_ledger(Place(str(folder), "1"), []):
        pass


def answer_study(folder: Path) -> None:
    (folder / MANIFEST).write_text("a study")
    StudyStore(folder).close()


def train(folder: Path) -> None:
    with keep_unfinished(folder / "m") as work:
        Checkpoint(work, "of this").save("stage", {"a": np.zeros(1)})
        raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("verb", "name"),
    [
        *((drop, name) for name in (LOCK, "project.json", "sounds", "sounds/line.wav")),
        *((pronounce, name) for name in ("lexicon.txt",)),
        *((train_voice, f"training/{name}") for name in ("", "recordings", "corpus", f"corpus/{LOCK}")),
        *((train_voice, name) for name in ("voices", "recordings")),
        *((add_to_corpus, name) for name in ("corpus.json", "utterances", "utterances/toy00", LEFT)),
        *((sync_corpus, name) for name in (LOCK, "utterances")),
        *((begin_batch, name) for name in (".batch", f".batch/{LOCK}", ".batch/work", "batch.jsonl", "report.csv")),
        *((answer_study, f"{ANSWERS}{suffix}") for suffix in ("", "-wal", "-shm", "-journal")),
        *((train, name) for name in ("m.unfinished", f"m.unfinished/{LOCK}", "m.unfinished/stage.checkpoint")),
    ],
)
def test_no_verb_follows_a_link_in_a_folder_of_a_stranger(tmp_path: Path, verb: Verb, name: str) -> None:
    """Each name once as a link to a folder, a file, an empty file and nothing, and as a second name of a file."""
    outside, folder = outside_of(tmp_path), tmp_path / "given.studio"
    before = content_of(outside)
    for number, aim in enumerate(("", "file", "empty", "new", "hard")):
        place = folder.with_name(f"given-{number}.studio") / name
        if verb in (add_to_corpus, sync_corpus):
            Corpus.create(folder.with_name(f"given-{number}.studio"))
        place.parent.mkdir(parents=True, exist_ok=True)
        files.remove(place)
        if aim == "hard":
            os.link(outside / "file", place)
        else:
            place.symlink_to(outside / aim)
        with suppress(LipMotionError, KeyboardInterrupt):
            verb(folder.with_name(f"given-{number}.studio"))
        assert content_of(outside) == before, aim


@pytest.mark.parametrize("write", [files.atomic_file, files.replace_folder])
def test_a_confined_folder_may_be_a_link_itself(tmp_path, write):
    (tmp_path / "there").mkdir()
    (tmp_path / "given").symlink_to("there")
    with lock_folder(tmp_path / "given"):
        files.make_folder(tmp_path / "given" / "a" / "b")
        with write(tmp_path / "given" / "a" / "b" / "c") as new:
            new.touch()
    assert (tmp_path / "there" / "a" / "b" / "c").exists()


def test_what_is_removed_is_not_behind_a_link(tmp_path: Path) -> None:
    outside = outside_of(tmp_path)
    before = content_of(outside)
    (tmp_path / "given").mkdir()
    for name, aim in (("one", outside), ("two", outside / "folder")):
        (tmp_path / "given" / name).symlink_to(aim)
    with files.confine(tmp_path / "given"):
        files.remove(tmp_path / "given" / "one" / "file")
        remove_unfinished(tmp_path / "given" / "one")
        files.remove(tmp_path / "given" / "two")
    assert content_of(outside) == before
    assert [path.name for path in (tmp_path / "given").iterdir()] == ["one"]


def test_a_file_that_is_added_to_is_nobody_elses(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("precious")
    os.link(tmp_path / "precious", tmp_path / "hard")
    (tmp_path / "soft").symlink_to("precious")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in ("hard", "soft", "folder", "pipe"):
        with pytest.raises(ExportError, match="is a link, a folder, a pipe"):
            files.open_own(tmp_path / name)
    assert (tmp_path / "precious").read_text() == "precious"


def test_folders_that_killed_runs_left_are_swept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not those that are in use, nor what a link of such a name leads to."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "lipmotion-killed" / "deep").mkdir(parents=True)
    (tmp_path / "lipmotion-killed" / LOCK).touch()
    (tmp_path / "precious").mkdir()
    for name in (LOCK, "file"):
        (tmp_path / "precious" / name).touch()
    (tmp_path / "lipmotion-link").symlink_to("precious")
    with open_temporary() as used:
        (used / "sound.wav").touch()
        with open_temporary() as other:
            assert other != used
        assert (used / "sound.wav").exists()
        assert not (tmp_path / "lipmotion-killed").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lipmotion-link", "precious"]
    assert sorted(path.name for path in (tmp_path / "precious").iterdir()) == [LOCK, "file"]
