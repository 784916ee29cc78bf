"""The Containerfile says what the repository has."""

import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
LINES = (ROOT / "Containerfile").read_text(encoding="utf-8").splitlines()
PIN = re.compile(r"^([\w.-]+==[\w.]+)", re.MULTILINE)


def after(word: str) -> list[str]:
    """Return the rest of each line of an instruction."""
    return [line.removeprefix(f"{word} ") for line in LINES if line.startswith(f"{word} ")]


def pins(name: str) -> set[str]:
    return set(PIN.findall((ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")))


def test_what_is_copied_is_there_and_the_base_and_the_command_are_right():
    copied = [name for line in after("COPY") for name in line.split()[:-1]]
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    packed = re.findall(r'^"(\w+)/\w+" = ', project.split("wheel.force-include]")[1].split("\n[")[0], re.MULTILINE)
    assert {"requirements", "pyproject.toml", "src", *packed} <= set(copied)
    assert packed
    assert all((ROOT / name).exists() for name in copied)
    kept = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert kept[0] == "*"
    assert set(kept[1:]) == {f"!{name}" for name in copied}
    (base,) = after("FROM")
    assert re.fullmatch(r"python:3\.1[0-2]-slim", base), "face tracking needs Python 3.10 to 3.12"
    (entry,) = after("ENTRYPOINT")
    assert f"{json.loads(entry)[0]} = " in project.split("[project.scripts]")[1]
    for name in re.findall(r"LIST=(\w+)", "\n".join(LINES)):
        assert pins(name)


def test_the_list_of_face_tracking_is_part_of_the_whole():
    assert pins("core") < pins("video") < pins("dev")
