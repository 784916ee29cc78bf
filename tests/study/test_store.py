import sqlite3
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion_studio.study.manifest import MANIFEST
from lipmotion_studio.study.store import ANSWERS, AnswerSheet, StudyStore, rater_name, rater_number
from study.small_study import small_study


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    small_study(tmp_path / "study")
    return tmp_path / "study"


@pytest.fixture
def store(folder: Path) -> Iterator[StudyStore]:
    with closing(StudyStore(folder)) as store:
        yield store


def test_the_first_answer_stands(store):
    number, _ = store.add_rater().result()
    first = AnswerSheet(number, 0, ("1", "2"), 3.5, 2)
    assert store.next_trial(number) == 0
    assert store.record(first).result()
    assert store.record(AnswerSheet(number, 0, ("5", "5"), 9.0, 7)).result()
    assert store.sheets() == [first]
    assert store.next_trial(number) == 1


def test_what_is_sent_by_many_at_once_is_stored_once(store):
    numbers = [store.add_rater().result()[0] for _ in range(10)]
    sheets = [AnswerSheet(number, trial, ("first",), 1.0, 2) for number in numbers for trial in range(8)]
    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(lambda sheet: store.record(sheet).result(), sheets * 5))
    assert store.sheets() == sheets


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
    assert [store.rater_of(token) for token in tokens] == list(range(1, 51))
    assert store.rater_of("") is store.rater_of("\ud800") is None
    stored = b"".join(path.read_bytes() for path in folder.glob(f"{ANSWERS}*"))
    assert not any(token.encode() in stored for token in tokens)


def test_a_forgotten_rater_is_gone_and_the_number_is_not_given_again(store, folder):
    numbers = [store.add_rater().result()[0] for _ in range(2)]
    for number in numbers:
        store.record(AnswerSheet(number, 0, (f"judgement-of-{number}",), 1.0, 2)).result()
    assert store.forget(2) == 1
    assert [sheet.rater for sheet in store.sheets()] == [1]
    stored = b"".join(path.read_bytes() for path in folder.glob(f"{ANSWERS}*"))
    assert b"judgement-of-1" in stored
    assert b"judgement-of-2" not in stored
    assert store.record(AnswerSheet(2, 1, ("first",), 1.0, 2)).result() is False
    assert store.add_rater().result()[0] == 3
    with pytest.raises(InputError, match="no rater r002"):
        store.forget(2)


def test_answers_are_still_there_after_the_next_start(folder):
    with closing(StudyStore(folder)) as store:
        number, token = store.add_rater().result()
        store.record(AnswerSheet(number, 0, ("first",), 1.0, 2)).result()
    with closing(StudyStore(folder)) as store:
        assert store.rater_of(token) == number
        assert store.next_trial(number) == 1


def test_answers_to_another_study_are_refused(folder):
    StudyStore(folder).close()
    path = folder / MANIFEST
    path.write_text(path.read_text(encoding="utf-8").replace("A study", "Another study"), encoding="utf-8")
    with pytest.raises(InputError, match="another study"):
        StudyStore(folder)


def test_a_file_that_is_no_database_is_refused(folder):
    (folder / ANSWERS).write_bytes(b"no database, but long enough to be taken for one" * 100)
    with pytest.raises(InputError, match="move it away"):
        StudyStore(folder)


def test_a_study_without_answers_says_how_to_get_some(folder):
    with pytest.raises(InputError, match="lipmotion study serve"):
        StudyStore(folder, create=False)


def test_a_failure_to_write_is_reported_and_passes(store):
    number, _ = store.add_rater().result()
    store._writer.execute("PRAGMA query_only = ON")  # as if the disk were full
    with pytest.raises(ExportError, match="cannot be written"):
        store.record(AnswerSheet(number, 0, ("first",), 1.0, 2)).result()
    store._writer.execute("PRAGMA query_only = OFF")
    assert store.record(AnswerSheet(number, 0, ("first",), 1.0, 2)).result()


def test_names_of_raters():
    assert [rater_number(rater_name(number)) for number in (1, 99, 12_345)] == [1, 99, 12_345]
    for name in ("", "r", "r-1", "x7", "r²", "r" + "9" * 30):
        with pytest.raises(InputError, match="as r007"):
            rater_number(name)
