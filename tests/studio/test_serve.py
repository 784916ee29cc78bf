"""``lipmotion studio`` as a process: kills in the middle of edits, hostile requests; and hundreds of edits undone."""

from __future__ import annotations

import shutil
from pathlib import Path
from random import Random

import pytest

from children import LIPMOTION, environment, run_child
from lipmotion.pipeline.edit_files import begun, read_edits
from lipmotion.pipeline.job import Request
from lipmotion.pipeline.model import Model
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio

pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")

from lipmotion.studio.line import OpenLine
from studio.attack import attacked
from studio.served import lost_edits, random_edit, served


@pytest.fixture
def line(toy_speech: Path, tmp_path: Path) -> Path:
    """A recording in a folder of its own, with files beside it that nobody may read."""
    return Path(shutil.copy(toy_speech, tmp_path / "line.wav"))


@pytest.mark.long
def test_kills_in_the_middle_lose_at_most_the_last_edit(line: Path, toy_model_file: Path, tmp_path: Path) -> None:
    errors = tmp_path / "errors.txt"
    found = lost_edits(line, toy_model_file, errors, kills=3, each_s=1.5)
    assert (found["kills"], found["lost"]) == (3, 0)
    assert found["acknowledged"] > 0
    assert "Traceback" not in errors.read_text(encoding="utf-8")


@pytest.mark.long
def test_hostile_requests_get_no_file_and_leave_no_traceback(line: Path, toy_model_file: Path, tmp_path: Path) -> None:
    errors = tmp_path / "errors.txt"
    with served(line, errors, toy_model_file) as server:
        server.ready()
        statuses = attacked(server, line.parent, 300)
        assert server.ready()["steps"] == [] or server.ready()["undo"] > 0
        server.process.terminate()
        assert server.process.wait(60) == 143
    assert {200, 401, 403, 404, 405, 422} <= statuses
    assert "Traceback" not in errors.read_text(encoding="utf-8")


@pytest.mark.long
def test_hundreds_of_edits_undone_give_the_first_motion(line: Path, toy_model: Model, tmp_path: Path) -> None:
    path, audio = tmp_path / "line.edits.json", analysed(read_audio(line))
    opened = OpenLine(begun(Request(line)), path, line, toy_model, audio)
    first, chance, refused = opened.numbers("delivered").values.tobytes(), Random(9), 0
    while opened.revision < 150:
        try:
            opened.edited(opened.revision, (random_edit(chance, opened.state()["phones"]),))
        except ValueError:
            refused += 1
    last, steps = opened.numbers("delivered").values.tobytes(), opened.state()["steps"]
    assert refused < 150
    again = OpenLine(read_edits(path), path, line, toy_model, audio)  # as after a restart
    assert (again.numbers("delivered").values.tobytes() == last, again.state()["steps"]) == (True, steps)
    while again.state()["undo"]:
        again.undone(again.revision, min(7, again.state()["undo"]))
    assert again.numbers("delivered").values.tobytes() == first
    again.redone(again.revision, len(steps))
    assert again.numbers("delivered").values.tobytes() == last


@pytest.mark.long
def test_without_the_extra_the_error_says_what_to_install(line: Path, tmp_path: Path) -> None:
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "uvicorn.py").write_text("raise ImportError('no uvicorn here')", encoding="utf-8")
    variables = environment()
    variables["PYTHONPATH"] = f"{tmp_path / 'without'}:{variables.get('PYTHONPATH', '')}"
    done = run_child([*LIPMOTION, "studio", line], variables=variables)
    assert done.returncode == 8
    assert "[studio]" in done.stderr
