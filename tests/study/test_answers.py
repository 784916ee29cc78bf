import csv
import json
from collections.abc import Callable
from typing import Any

import pytest

from lipmotion.errors import InputError
from lipmotion_studio.study.answers import COLUMNS, KINDS, Answer, is_possible, read_answers, write_answers
from lipmotion_studio.study.manifest import MANIFEST, check_videos, read_study
from study.small_study import small_study

ANSWERS = [
    Answer("r1", "paired", 0, 'say "b", now', "preference", "recording", "trajectory", "first", 12.5, 2, False, ""),
    Answer("r1", "mos", 1, "bin blue", "smoothness", "anchor", "", "1", 8.25, 1, True, "1"),
    Answer("r2", "ranking", 0, "bin blue", "overall", "coupled", "", "100", 30.0, 3, False, ""),
]


def test_a_table_is_read_as_it_was_written(tmp_path):
    write_answers(tmp_path / "answers.csv", ANSWERS)
    assert read_answers(tmp_path / "answers.csv") == ANSWERS


@pytest.mark.parametrize("name", ["=1+1", "@SUM(A1)", "+1", "-1", "\tx", "\rx", "'=1", "\uff1d1", " =1"])
def test_no_name_is_a_formula_in_the_table(tmp_path, name):
    answer = Answer("r1", "mos", 0, name, "smoothness", name, name, "1", 8.25, 1, False, "")
    write_answers(tmp_path / "answers.csv", [answer])
    with (tmp_path / "answers.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[1][COLUMNS.index("condition")] == f"'{name}"
    assert read_answers(tmp_path / "answers.csv") == [answer]


@pytest.mark.parametrize(
    ("kind", "value", "wanted"),
    [
        ("paired", "first", True), ("paired", "both", False), ("mos", "5", True), ("mos", "0", False),
        ("mos", "6", False), ("mos", "3.5", False), ("mos", "٣", False), ("ranking", "0", True),
        ("ranking", "101", False), ("ranking", "-1", False), ("ranking", "", False),
    ],
)  # fmt: skip
def test_possible_values(kind, value, wanted):
    assert is_possible(kind, value) == wanted


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rater,", "person,", "no column 'rater'; required rater"),
        (",first,", ",neither,", "line 2: the answer 'neither', required 'first' or 'second'"),
        (",12.5,2,0,", ",12.5,two,0,", "line 2: plays"),
        ("ranking", "guess", "line 4: an answer of the kind 'guess', required one of paired, mos, ranking"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, old, new, message):
    path = tmp_path / "answers.csv"
    write_answers(path, ANSWERS)
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_answers(path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_study_survives_its_file(tmp_path, kind):
    study = small_study(tmp_path / "study", kind)
    assert read_study(tmp_path / "study") == study
    assert set(check_videos(study, tmp_path / "study")) == {video.file for video in study.videos}


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


def test_videos_that_are_missing_or_changed_are_noticed(tmp_path):
    study = small_study(tmp_path / "study")
    path = check_videos(study, tmp_path / "study")[study.videos[0].file]
    path.write_bytes(b"another video")
    with pytest.raises(InputError, match="has changed"):
        check_videos(study, tmp_path / "study")
    path.unlink()
    with pytest.raises(InputError, match="is missing"):
        check_videos(study, tmp_path / "study")
