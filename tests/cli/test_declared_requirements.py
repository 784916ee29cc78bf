import re
from importlib import metadata
from pathlib import Path

import pytest
from packaging.markers import default_environment

from lipmotion.cli.doctor import EXTRAS, Requirement, declared_requirements, requirement

PYPROJECT = Path(__file__).parents[2] / "pyproject.toml"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("av>=14", Requirement("av", ">=14")),
        ("torch>=2.4; extra == 'network'", Requirement("torch", ">=2.4", "", "network")),
        ("opencv-python-headless (<5,>=4.10)", Requirement("opencv-python-headless", "<5,>=4.10")),
        (
            "mediapipe==0.10.14; (python_version < '3.13') and extra == 'video'",
            Requirement("mediapipe", "==0.10.14", 'python_version < "3.13"', "video"),
        ),
    ],
)
def test_requirements_are_read(text, expected):
    assert requirement(text) == expected


def test_markers(monkeypatch):
    machine = {"sys_platform": "darwin", "platform_machine": "arm64", "python_version": "3.9"}
    monkeypatch.setattr("packaging.markers.default_environment", lambda: default_environment() | machine)
    for marker, expected in (
        ("", True),
        ("python_version < '3.13'", True),
        ("python_version >= '3.10'", False),
        ("(sys_platform == 'linux' and platform_machine == 'arm64') or (sys_platform == 'darwin')", True),
        ("sys_platform != 'darwin' or platform_machine != 'arm64'", False),
    ):
        assert Requirement("a", "", marker).applies is expected, marker


def test_versions(monkeypatch):
    monkeypatch.setattr("importlib.metadata.version", lambda _: "4.10.0.84")
    for versions, expected in (
        ("", True),
        (">=4.9", True),
        (">=4.10,<5", True),
        ("<4.9", False),
        ("==4.10.0.84.0", True),
        ("!=4.10.0.84", False),
        (">4.10.0.84", False),
    ):
        assert Requirement("a", versions).is_met is expected, versions


def test_what_is_not_installed(monkeypatch):
    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.version", missing)
    monkeypatch.setattr("importlib.metadata.requires", missing)
    assert not Requirement("a", "").is_met
    assert declared_requirements() == ()


def test_every_extra_is_explained():
    table = PYPROJECT.read_text(encoding="utf-8").split("[project.optional-dependencies]")[1].split("\n[")[0]
    assert set(re.findall(r"^([\w-]+) = \[", table, re.MULTILINE)) == set(EXTRAS)
