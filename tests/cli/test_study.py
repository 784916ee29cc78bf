import json
import socket
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import check_refused, is_one_error
from lipmotion import analyse_study
from lipmotion_studio.folder import open_folder
from lipmotion_studio.study.answers import write_answers
from study.simulated import Effects, comparisons, paired_answers, rated_answers, ratings
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


@pytest.mark.parametrize("words", [("serve", "none"), ("export", "none", "-o", "a.csv"), ("forget", "none", "r001")])
def test_what_is_no_study_is_one_error(here, run, words):
    assert is_one_error(run("study", *words), 3)
    assert list(here.iterdir()) == []


def write_study(path: Path) -> None:
    draw = np.random.default_rng(2)
    answers = rated_answers(ratings(draw, np.array([3.0, 4.0]), (8, 6), Effects()))
    write_answers(path, answers + paired_answers(comparisons(draw, np.array([-0.5, 0.5]), (8, 6), Effects())))


def test_the_figures_are_those_of_the_function_and_programs_read_lines_of_json(run, here):
    write_study(here / "answers.csv")
    done = run("study", "analyse", "answers.csv", "-o", "result.json", "--baseline", "c1", "--sentences", "12")
    assert (done.code, done.err) == (0, [])
    figures = analyse_study(here / "answers.csv", baseline="c1", sentences=12)
    assert any("c1" in line for line in done.out)
    assert json.loads((here / "result.json").read_text()).keys() == figures.keys()
    done = run("study", "analyse", "answers.csv", "--machine-readable")
    assert done.code == 0
    assert [part["kind"] for part in json.loads(done.out[-1])["figures"]["all"]] == ["mos", "paired"]


def test_what_cannot_be_used(run, here):
    write_study(here / "answers.csv")
    (here / "other.csv").write_text("rater,kind\n1,2\n")
    for arguments, code, words in (
        (("other.csv",), 3, "no column"),
        (("nothing.csv",), 3, "nothing.csv"),
        (("answers.csv", "--baseline", "c7"), 3, "the baseline is 'c7', required one of: c0, c1"),
        (("answers.csv", "--power", "2"), 3, "a power of 2"),
        (("answers.csv", "-o", "answers.csv"), 7, "answers.csv"),
    ):
        check_refused(run("study", "analyse", *arguments), code, words)


def test_what_the_studio_refuses(here, run):
    pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")
    assert is_one_error(run("studio", "nothing.wav"), 3)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert is_one_error(run("studio", "--port", taken.getsockname()[1], "-o", "project"), 3)
    with open_folder(None, here / "project"):  # as by another studio
        assert is_one_error(run("studio", "-o", "project"), 7)
    (here / "project" / "project.json").write_text("{}", encoding="utf-8")
    assert is_one_error(run("studio", "project"), 3)
