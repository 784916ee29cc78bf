import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import pytest

from lipmotion.cli import doctor as doctor_module
from lipmotion.cli.doctor import EXTRAS, InstalledPart, doctor
from lipmotion.errors import LipMotionError
from lipmotion.extensions import install_command
from lipmotion.speech.voices.synthesiser import SyntheticVoice

MAIN = "from lipmotion.cli.main import main; sys.exit(main())"


@pytest.fixture
def declared(monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, InstalledPart]]:
    """Returns what is found, by name, where some requirements are declared and no part is looked at."""

    def found(*requirements: str) -> dict[str, InstalledPart]:
        monkeypatch.setattr(metadata, "requires", lambda _: requirements)
        monkeypatch.setattr(doctor_module, "_PARTS", {})
        return {each.name: each for each in doctor()}

    return found


def test_packages(declared):
    found = declared(
        "numpy>=2",
        "pytest<1",
        "no-such-package==1",
        "no-such-package==2 ; sys_platform == 'none'",
        "no-such-kind ; sys_platform == 'none'",
        "numpy>=2 ; extra == 'plots'",
        "no-such-package>=1 ; extra == 'study'",
        "no-such-package ; sys_platform == 'none' and extra == 'video'",
    )
    assert found["numpy"].state == "works"
    assert found["pytest"].state == "broken"
    assert "required <1: pip install 'pytest<1'" in found["pytest"].text
    assert found["no-such-package"].text.startswith("not installed, required ==1")
    assert (found["no-such-kind"].state, found["[plots]"].state) == ("absent", "works")
    assert found["[study]"].state == "absent"
    assert f"{install_command('study')}; there is no no-such-package (required >=1)" in found["[study]"].text
    assert 'not for this Python or system (required: sys_platform == "none"' in found["[video]"].text
    assert declared()["packages"].state == "absent"  # without metadata


def test_voices(monkeypatch):
    from lipmotion.speech.voices.installed import SYNTHESISERS

    def fails() -> tuple[()]:
        raise LipMotionError("no data")

    some = replace(SYNTHESISERS["flite"], voices=tuple, others=tuple)
    speaking = replace(some, name="c", voices=lambda: (SyntheticVoice("kal", "c", "kal"),))
    changed = {"a": replace(some, name="a", voices=fails), "b": replace(some, name="b"), "c": speaking}
    monkeypatch.setattr("lipmotion.speech.voices.installed.SYNTHESISERS", changed)
    found = doctor_module.look_at("voices")
    assert (found.state, found.text) == ("works", "c 1; a does not work (no data); no b (apt install flite)")
    del changed["c"]
    found = doctor_module.look_at("voices")
    assert found.state == "absent"
    assert "no speech synthesiser is installed; install one: pip install" in found.text


def test_whatever_a_part_raises(monkeypatch):
    def fails() -> str:
        raise OSError("libfoo.so: cannot open")

    monkeypatch.setitem(doctor_module._PARTS, "foo", fails)
    found = doctor_module.look_at("foo")
    assert found == InstalledPart("foo", "broken", "OSError: libfoo.so: cannot open; install lipmotion again")


def test_parts_that_are_not_there(monkeypatch):
    monkeypatch.setitem(sys.modules, "mediapipe.python.solutions", None)
    monkeypatch.setattr(doctor_module, "find_spec", lambda name: name == "sounddevice")
    monkeypatch.setattr(doctor_module, "find_library", lambda _: None)
    for part, missing in (("face tracking", "MediaPipe"), ("microphone", "libportaudio2")):
        found = doctor_module.look_at(part)
        assert (found.state, missing in found.text) == ("absent", True)


@pytest.mark.long
def test_the_main_path():
    found = doctor_module.look_at("main path")
    assert found.state == "works"
    assert "1.0 s of made-up speech → json, cues.tsv, mp4; the lips open by 0." in found.text


@pytest.mark.long
def test_without_numpy(run_outside, tmp_path):
    """What most needs a doctor: nothing of it is imported before it is looked at."""
    for module in ("numpy", "av"):
        (tmp_path / f"{module}.py").write_text(f"raise ImportError('no {module}')")
    program = (sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); " + MAIN)
    done = run_outside("doctor", program=program)
    states = {line[8:28].strip(): line[:8].strip() for line in done.out}
    assert done.code == 1
    assert {states["FFmpeg"], states["main path"], states["model that ships"]} == {"broken"}
    assert states["temporary folder"] == "works"
    assert "broken: FFmpeg" in done.err[-1]


GOOD = ("numpy>=2", "no-such-package ; sys_platform == 'none'")
STATES = [("works", "lipmotion"), ("absent", "no-such-package"), ("works", "numpy")]
BROKEN = "pytest<1"


def test_what_is_absent_is_no_failure(run, declared):
    declared(*GOOD)
    done = run("doctor")
    assert (done.code, done.err) == (0, [])
    assert [tuple(line.split()[:2]) for line in done.out[:-1]] == STATES


def test_what_is_broken_is_exit_code_1(run, declared):
    declared(*GOOD, BROKEN)
    done = run("doctor")
    assert done.code == 1
    assert done.out[-1].split()[:2] == ["broken", "pytest"]
    assert done.err == ["lipmotion: error: broken: pytest; what to do is said above"]


def test_for_programs(run, declared):
    declared(*GOOD)
    done = run("doctor", "--machine-readable")
    start, *items, success = map(json.loads, done.out)
    assert (done.code, start["type"], success) == (0, "start", {"type": "success", "broken": []})
    assert [(each["outcome"], each["name"]) for each in items] == STATES
    declared(BROKEN)
    done = run("doctor", "--machine-readable")
    assert done.code == 1
    assert json.loads(done.out[-1])["type"] == "failure"


PYPROJECT = Path(__file__).parents[2] / "pyproject.toml"


def test_every_extra_is_explained():
    table = PYPROJECT.read_text(encoding="utf-8").split("[project.optional-dependencies]")[1].split("\n[")[0]
    assert set(re.findall(r"^([\w-]+) = \[", table, re.MULTILINE)) == set(EXTRAS)
