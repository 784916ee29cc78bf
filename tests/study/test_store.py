import csv
import json
import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion_studio.study.answers import COLUMNS, KINDS, Answer, read_answers, write_answers
from lipmotion_studio.study.manifest import MANIFEST, check_videos, read_study
from lipmotion_studio.study.store import ANSWERS, AnswerSheet, StudyStore
from study.small_study import small_study


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    small_study(tmp_path / "study")
    return tmp_path / "study"


@pytest.fixture
def store(folder: Path) -> Iterator[StudyStore]:
    with closing(StudyStore(folder)) as store:
        yield store


def test_the_first_answer_stands_also_after_the_next_start(store, folder):
    number, token = store.add_rater().result()
    first = AnswerSheet(number, 0, ("1", "2"), 3.5, 2)
    assert store.find_next_trial(number) == 0
    assert store.record(first).result()
    store.close()
    with closing(StudyStore(folder)) as again:
        assert again.find_rater(token) == number
        assert again.record(AnswerSheet(number, 0, ("5", "5"), 9.0, 7)).result()
        assert again.list_sheets() == [first]
        assert again.find_next_trial(number) == 1


def test_what_is_sent_by_many_at_once_is_stored_once(store):
    numbers = [store.add_rater().result()[0] for _ in range(10)]
    sheets = [AnswerSheet(number, trial, ("first",), 1.0, 2) for number in numbers for trial in range(8)]
    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(lambda sheet: store.record(sheet).result(), sheets * 5))
    assert store.list_sheets() == sheets


def test_a_failure_to_write_is_reported_and_passes(store):
    number, _ = store.add_rater().result()
    store._writer.execute("PRAGMA query_only = ON")  # as if the disk were full
    with pytest.raises(ExportError, match="cannot be written"):
        store.record(AnswerSheet(number, 0, ("first",), 1.0, 2)).result()
    store._writer.execute("PRAGMA query_only = OFF")
    assert store.record(AnswerSheet(number, 0, ("first",), 1.0, 2)).result()


def test_an_answer_is_on_the_disk_before_it_is_acknowledged(store, folder):
    number, _ = store.add_rater().result()
    store.record(AnswerSheet(number, 0, ("first",), 1.0, 2)).result()
    with closing(sqlite3.connect(folder / ANSWERS)) as other:
        assert other.execute("SELECT count(*) FROM answers").fetchone() == (1,)
        assert other.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert store._writer.execute("PRAGMA synchronous").fetchone() == (2,)  # FULL: the log reaches the disk


def test_tokens_are_long_and_different_and_not_stored(store, folder):
    tokens = [store.add_rater().result()[1] for _ in range(50)]
    assert len(set(tokens)) == 50
    assert min(map(len, tokens)) >= 32
    assert [store.find_rater(token) for token in tokens] == list(range(1, 51))
    assert store.find_rater("") is store.find_rater("\ud800") is None
    stored = b"".join(path.read_bytes() for path in folder.glob(f"{ANSWERS}*"))
    assert not any(token.encode() in stored for token in tokens)


def test_a_forgotten_rater_is_gone_and_the_number_is_not_given_again(store, folder):
    numbers = [store.add_rater().result()[0] for _ in range(2)]
    for number in numbers:
        store.record(AnswerSheet(number, 0, (f"judgement-of-{number}",), 1.0, 2)).result()
    assert store.forget(2) == 1
    assert [sheet.rater for sheet in store.list_sheets()] == [1]
    stored = b"".join(path.read_bytes() for path in folder.glob(f"{ANSWERS}*"))
    assert b"judgement-of-1" in stored
    assert b"judgement-of-2" not in stored
    assert store.record(AnswerSheet(2, 1, ("first",), 1.0, 2)).result() is False
    assert store.add_rater().result()[0] == 3
    with pytest.raises(InputError, match="no rater r002"):
        store.forget(2)


def test_no_answers_those_of_another_study_and_what_is_no_database_are_refused(folder):
    with pytest.raises(InputError, match="lipmotion study serve"):
        StudyStore(folder, create=False)
    StudyStore(folder).close()
    path = folder / MANIFEST
    path.write_text(path.read_text(encoding="utf-8").replace("A study", "Another study"), encoding="utf-8")
    with pytest.raises(InputError, match="another study"):
        StudyStore(folder)
    (folder / ANSWERS).write_bytes(b"no database, but long enough to be taken for one" * 100)
    with pytest.raises(InputError, match="move it away"):
        StudyStore(folder)


SIX = [
    Answer("r1", "paired", 0, 'say "b", now', "preference", "recording", "trajectory", "first", 12.5, 2, False, ""),
    Answer("r1", "mos", 1, "bin blue", "smoothness", "anchor", "", "1", 8.25, 1, True, "1"),
    Answer("r2", "mos", 0, "bin blue", "overall", "coupled", "", "5", 30.0, 3, False, ""),
]


@pytest.mark.parametrize("name", ["=1+1", "@SUM(A1)", "+1", "-1", "\tx", "\rx", "'=1", "\uff1d1", " =1"])
def test_no_name_is_a_formula_in_the_table(tmp_path, name):
    answer = Answer("r1", "mos", 0, name, "smoothness", name, name, "1", 8.25, 1, False, "")
    write_answers(tmp_path / "answers.csv", [answer])
    with (tmp_path / "answers.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[1][COLUMNS.index("condition")] == f"'{name}"
    assert read_answers(tmp_path / "answers.csv") == [answer]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rater,", "person,", "no column 'rater'; required rater"),
        (",first,", ",neither,", "line 2: the answer 'neither', required 'first' or 'second'"),
        (",12.5,2,0,", ",12.5,two,0,", "line 2: plays"),
        ("r2,mos", "r2,guess", "line 4: an answer of the kind 'guess', required one of paired, mos"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, old, new, message):
    path = tmp_path / "answers.csv"
    write_answers(path, SIX)
    assert read_answers(path) == SIX
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_answers(path)


def put(**members: Any) -> Callable[[dict[str, Any]], object]:
    return lambda content: content.update(members)


@pytest.mark.parametrize(
    "change",
    [
        put(version=2), put(format="other"), put(kind="guess"), put(trials=[]), put(trials=[{"videos": [0, 999]}]),
        put(trials=[{"videos": [0]}]), put(trials=[{"videos": [0, 1], "expected": "third"}]), put(surprise=1),
        put(title=7), put(videos={}), lambda content: content["videos"][0].update(file="../../secret.mp4"),
        lambda content: content.pop("seed"),
    ],
)  # fmt: skip
def test_a_manifest_that_was_changed_is_refused(tmp_path, change):
    small_study(tmp_path / "study")
    path = tmp_path / "study" / MANIFEST
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(InputError, match="design it again"):
        read_study(tmp_path / "study")


def test_a_folder_that_is_no_study_says_how_to_make_one(tmp_path):
    with pytest.raises(InputError, match="lipmotion study design"):
        read_study(tmp_path)
    (tmp_path / MANIFEST).write_text("[]", encoding="utf-8")
    with pytest.raises(InputError, match="not a study"):
        read_study(tmp_path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_study_survives_its_file(tmp_path, kind):
    study = small_study(tmp_path / "study", kind)
    assert read_study(tmp_path / "study") == study
    assert set(check_videos(study, tmp_path / "study")) == {video.file for video in study.videos}


def test_videos_that_are_missing_or_changed_are_noticed(tmp_path):
    study = small_study(tmp_path / "study")
    path = check_videos(study, tmp_path / "study")[study.videos[0].file]
    path.write_bytes(b"another video")
    with pytest.raises(InputError, match="has changed"):
        check_videos(study, tmp_path / "study")
    path.unlink()
    with pytest.raises(InputError, match="is missing"):
        check_videos(study, tmp_path / "study")
