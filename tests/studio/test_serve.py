"""``lipmotion studio`` as a process: kills while it is edited, hostile requests, edits undone to the first bytes."""

import shutil
from pathlib import Path
from random import Random

import pytest

from children import LIPMOTION, environment, run_child
from lipmotion.pipeline.edits import STEPS, parse_step

pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")

from studio.hostile import attack
from studio.served import edits_of_all_kinds, lost_edits, served
from study.small_study import small_study


@pytest.fixture
def line(toy_speech: Path, tmp_path: Path) -> Path:
    """A recording in a folder of its own, with files beside it that nobody may read."""
    return Path(shutil.copy(toy_speech, tmp_path / "line.wav"))


@pytest.mark.long
def test_kills_in_the_middle_lose_at_most_the_last_edit(line, toy_model_file, tmp_path):
    errors = tmp_path / "errors.txt"
    found = lost_edits(line, errors, 3, 1.5, "--model", toy_model_file)
    assert (found["kills"], found["lost"]) == (3, 0)
    assert found["acknowledged"] > 0
    assert "Traceback" not in errors.read_text(encoding="utf-8")


@pytest.mark.long
def test_hostile_requests_get_no_file_and_leave_no_traceback(line, toy_model_file, tmp_path):
    errors = tmp_path / "errors.txt"
    with served(line, errors, "--model", toy_model_file) as server:
        server.ready()
        statuses = attack(server, line.parent, 500)
        assert server.ready()["steps"] == [] or server.ready()["undo"] > 0
        server.process.terminate()
        assert server.process.wait(60) == 143
    assert {200, 401, 403, 404, 405, 422} <= statuses
    assert "Traceback" not in errors.read_text(encoding="utf-8")


def test_random_edits_are_of_all_kinds():
    phones = [{"start_s": n / 5, "end_s": (n + 1) / 5} for n in range(9)]
    state = {"phones": phones, "words": [{}], "steps": ["lock from 0.2 to 0.4"]}
    assert {parse_step(edit).form for edit in edits_of_all_kinds(Random(1), state)} == {*STEPS}


@pytest.mark.long
@pytest.mark.parametrize("command", [("studio",), ("study", "serve")])
def test_without_the_extra_the_error_says_what_to_install(line, tmp_path, command):
    small_study(tmp_path / "study")
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "uvicorn.py").write_text("raise ImportError('no uvicorn here')", encoding="utf-8")
    variables = environment()
    variables["PYTHONPATH"] = f"{tmp_path / 'without'}:{variables.get('PYTHONPATH', '')}"
    given = line if command == ("studio",) else tmp_path / "study"
    done = run_child([*LIPMOTION, *command, given], variables=variables)
    assert done.returncode == 8
    assert f"[{command[0]}]" in done.stderr
