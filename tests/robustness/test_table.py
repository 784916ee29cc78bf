from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from children import LIPMOTION, run_child
from cli.conftest import RunCommand
from lipmotion.cli import info
from robustness.case import CASES, Bench, Case
from robustness.document import DOCUMENT, rendered

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="pipes, devices and names as Linux has them")
LARGE = ("five million rows", "two million words", "300,000 units", "half a million subtitles")
"""Cases that take a second and more."""


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[pytest.mark.long] * case.name.endswith(LARGE)) for case in CASES],
    ids=lambda case: f"{case.group}: {case.name}",
)
def test_bad_input(case: Case, bench: Bench, run: RunCommand, here: Path, caplog: pytest.LogCaptureFixture) -> None:
    if case.group == "videos":
        pytest.importorskip("mediapipe")
    done = run(*case.make(bench))
    printed = " ".join([*done.err, *(record.getMessage() for record in caplog.records)])
    assert done.code == case.code, done
    assert "Traceback" not in printed
    for words in case.messages:
        assert words in printed
    if case.code:
        assert done.out == []
        *before, last = done.err
        assert last.startswith("lipmotion: error: ")
        assert all(line.startswith("lipmotion: warning: ") for line in before)
        assert sum("skipped" in line for line in before) == ("none of 1 recordings" in last)
        assert list(here.iterdir()) == []
    else:
        assert all(line.startswith("lipmotion: warning: ") for line in done.err)
        assert bool(caplog.records or done.err) == bool(case.messages), printed
        for path in here.glob("*.json"):
            json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_a_full_disk_behind_the_standard_output() -> None:
    with Path("/dev/full").open("w") as full:
        done = run_child([*LIPMOTION, "info"], stdout=full)
    assert done.stderr == "lipmotion: error: standard output cannot be written: No space left on device\n"
    assert done.returncode == 7


def test_not_enough_memory(run: RunCommand, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise MemoryError("Unable to allocate 7 TiB")

    monkeypatch.setattr(info, "run", fail)
    done = run("info")
    assert done.code == 3
    assert done.err == [
        "lipmotion: error: not enough memory (Unable to allocate 7 TiB); give a shorter recording or a smaller file"
    ]


def test_there_are_many_and_none_twice() -> None:
    names = [(case.group, case.name) for case in CASES]
    assert len(names) >= 90
    assert len(set(names)) == len(names)


def test_the_document_has_all_of_them() -> None:
    """To update it, run ``python -m robustness.document`` with the folder ``tests`` in PYTHONPATH."""
    assert rendered() == DOCUMENT.read_text(encoding="utf-8")
