from contextlib import closing

import pytest

from cli.conftest import is_one_error
from lipmotion_studio.study.answers import read_answers
from lipmotion_studio.study.store import AnswerSheet, StudyStore
from study.small_study import small_study
from study.test_design import write_video


def test_design_makes_a_study(here, run):
    for name in ("one", "two"):
        write_video(here / "said" / f"{name}.mp4", 10)
        write_video(here / "ours" / f"{name}.mp4", 90)
    words = ["--condition", "recording", "--condition", "ours=ours", "--sentence", "said/one.mp4", "said/two.mp4"]
    done = run("study", "design", "-o", "study", "--paired", *words, "--practice", "1", "--anchor-ms", "100")
    assert (done.code, done.out) == (0, ["study: 6 videos, 8 trials for each rater"])
    assert is_one_error(run("study", "design", "-o", "study", "--mos", *words), 7)
    assert is_one_error(run("study", "design", "-o", "other", "--mos", *words, "--scales", "beauty"), 3)
    assert run("study", "design", "-o", "other", "--paired", "--mos", *words).code == 2


def test_export_and_forget(here, run):
    small_study(here / "study")
    with closing(StudyStore(here / "study")) as store:
        for _ in range(2):
            number, _ = store.add_rater().result()
            store.record(AnswerSheet(number, 0, ("first",), 1.5, 2)).result()
    done = run("study", "export", "study", "-o", "answers.csv")
    assert (done.code, done.out) == (0, ["answers.csv: 2 answers"])
    assert [row.rater for row in read_answers(here / "answers.csv")] == ["r001", "r002"]
    done = run("study", "export", "study", "--rater", "r2", "-o", "one.csv")
    assert (done.code, done.out) == (0, ["one.csv: 1 answers"])
    assert [row.rater for row in read_answers(here / "one.csv")] == ["r002"]
    for nobody in ("r003", "anna"):
        assert is_one_error(run("study", "export", "study", "--rater", nobody, "-o", "none.csv"), 3)
    done = run("study", "forget", "study", "r001")
    assert (done.code, done.out[0].split(";")[0]) == (0, "r001: 1 answers deleted")
    assert is_one_error(run("study", "forget", "study", "r001"), 3)
    run("study", "export", "study", "-o", "answers.csv")
    assert [row.rater for row in read_answers(here / "answers.csv")] == ["r002"]


@pytest.mark.parametrize("words", [("serve", "none"), ("export", "none", "-o", "a.csv"), ("forget", "none", "r001")])
def test_what_is_no_study_is_one_error(here, run, words):
    assert is_one_error(run("study", *words), 3)
    assert list(here.iterdir()) == []
