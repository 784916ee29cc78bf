from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from cli.conftest import RunCommand, is_one_error
from lipmotion.storage.json_text import nan_as_null
from lipmotion_studio.study.analysis.analyse import analyse_study, analysis_table
from lipmotion_studio.study.answers import write_answers
from study.analysis.simulated import Effects, comparisons, paired_answers, rated_answers, ratings


def write_study(path: Path) -> None:
    draw = np.random.default_rng(2)
    answers = rated_answers(ratings(draw, np.array([3.0, 4.0]), (8, 6), Effects()))
    write_answers(path, answers + paired_answers(comparisons(draw, np.array([-0.5, 0.5]), (8, 6), Effects())))


def test_the_figures_are_those_of_the_function(run: RunCommand, here: Path) -> None:
    write_study(here / "answers.csv")
    done = run("study", "analyse", "answers.csv", "-o", "result.json", "--baseline", "c1", "--sentences", "12")
    assert (done.code, done.err) == (0, [])
    figures = analyse_study(here / "answers.csv", baseline="c1", sentences=12)
    assert "\n".join(done.out) == analysis_table(figures)
    assert json.loads((here / "result.json").read_text()) == json.loads(json.dumps(nan_as_null(figures)))


def test_programs_read_lines_of_json(run: RunCommand, here: Path) -> None:
    write_study(here / "answers.csv")
    done = run("study", "analyse", "answers.csv", "--machine-readable")
    assert done.code == 0
    assert [part["kind"] for part in json.loads(done.out[-1])["figures"]["all"]] == ["mos", "paired"]


def test_what_cannot_be_used(run: RunCommand, here: Path) -> None:
    write_study(here / "answers.csv")
    (here / "other.csv").write_text("rater,kind\n1,2\n")
    for arguments, code, words in (
        (("other.csv",), 3, "no column"),
        (("nothing.csv",), 3, "nothing.csv"),
        (("answers.csv", "--baseline", "c7"), 3, "the baseline 'c7', required one of: c0, c1"),
        (("answers.csv", "--power", "2"), 3, "a power of 2"),
        (("answers.csv", "-o", "answers.csv"), 7, "answers.csv"),
    ):
        done = run("study", "analyse", *arguments)
        assert is_one_error(done, code), done
        assert words in done.err[0]
