from __future__ import annotations

import json

import pytest

from cli.conftest import RunCommand
from lipmotion.cli.doctor import InstalledPart

GOOD = (InstalledPart("numpy", "works", "2.4"), InstalledPart("[vosk]", "absent", "pip install 'lipmotion[vosk]'"))
BROKEN = InstalledPart("main path", "broken", "no model")


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> list[InstalledPart]:
    """What is found, which a test may change."""
    findings = list(GOOD)
    monkeypatch.setattr("lipmotion.cli.doctor.doctor", lambda: iter(findings))
    return findings


def test_what_is_absent_is_no_failure(run: RunCommand, found: list[InstalledPart]) -> None:
    done = run("doctor")
    assert (done.code, done.err) == (0, [])
    assert done.out[0].split() == ["works", "numpy", "2.4"]
    assert done.out[1].split()[:2] == ["absent", "[vosk]"]
    assert len(done.out) == len(found) + 1


def test_what_is_broken_is_exit_code_1(run: RunCommand, found: list[InstalledPart]) -> None:
    found.append(BROKEN)
    done = run("doctor")
    assert done.code == 1
    assert done.out[-1].split() == ["broken", "main", "path", "no", "model"]
    assert done.err == ["lipmotion: error: broken: main path; what to do is said above"]


def test_for_programs(run: RunCommand, found: list[InstalledPart]) -> None:
    done = run("doctor", "--machine-readable")
    start, *items, success = map(json.loads, done.out)
    assert (done.code, start["type"], success) == (0, "start", {"type": "success", "broken": []})
    assert [(each["name"], each["outcome"]) for each in items] == [("numpy", "works"), ("[vosk]", "absent")]
    found.append(BROKEN)
    done = run("doctor", "--machine-readable")
    assert done.code == 1
    assert json.loads(done.out[-1])["type"] == "failure"
