"""``completion``: what the scripts offer, asked of the shells themselves where they are installed."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import pytest

from children import run_child
from cli.conftest import RunCommand
from lipmotion.cli.arguments.shell_completion import SHELLS, places
from lipmotion.cli.command_line import parser

ASKED: dict[tuple[str, ...], set[str]] = {
    ("cue",): {"cues"},
    ("corpus", "pre"): {"prepare"},
    ("corpus", "prepare", "--no"): {"--no-crops"},
    ("face", "info", "--struc"): set(),
    ("info", "--struc"): {"--structure"},
    ("cues", "a.wav", "--datF"): {"--datFrameRate"},
    ("animate", "--pauses", ""): {"rest", "natural"},
    ("animate", "a.wav", "-o", "ou"): set(),
    ("completion", ""): set(SHELLS),
}
"""The words of a command line, and what may stand for the last of them; nothing: a file is meant."""
BASH = 'source "$1"; complete -p lipmotion; shift; COMP_WORDS=(lipmotion "$@"); COMP_CWORD=$#; _lipmotion'


@pytest.fixture(params=list(SHELLS))
def shell(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def script_file(run: RunCommand, shell: str, tmp_path: Path) -> Path:
    done = run("completion", shell)
    assert (done.code, done.err) == (0, [])
    path = tmp_path / f"script.{shell}"
    path.write_text("\n".join(done.out) + "\n")
    return path


def test_all_verbs_and_options_are_offered(script_file: Path) -> None:
    text = script_file.read_text()
    found = list(places(parser()))
    assert len(found) > 30
    for place in found:
        assert all(f"/{name}" in text for name in place.path)
        for names, *_ in place.options:
            assert all(name.lstrip("-") in text for name in names), (place.path, names)
    assert not re.search("@[A-Z]", text)


@pytest.mark.parametrize("shell", ["bash"])
@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes(script_file: Path) -> None:
    for words, expected in ASKED.items():
        program = f"{BASH}; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        done = run_child(["bash", "--norc", "-c", program, "bash", script_file, *words], check=True)
        registered, *offered = done.stdout.split("\n")
        assert registered == "complete -o bashdefault -o default -F _lipmotion lipmotion"
        assert set(filter(None, offered)) == expected, words
        assert done.stderr == ""


@pytest.mark.parametrize("shell", ["zsh"])
@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh")
def test_zsh_finds_the_same(script_file: Path) -> None:
    for words, expected in ASKED.items():
        program = 'compdef() { }; source "$1"; shift; _lipmotion_candidates "$argv[-1]" "${(@)argv[1,-2]}"'
        done = run_child(["zsh", "-f", "-c", program, "zsh", script_file, *words], check=True)
        assert {word for word in done.stdout.split() if word.startswith(words[-1])} == expected, words
        assert done.stderr == ""


@pytest.mark.parametrize("shell", ["fish"])
@pytest.mark.skipif(shutil.which("fish") is None, reason="no fish")
def test_fish_completes(script_file: Path) -> None:
    for words, expected in ASKED.items():
        line = " ".join(["lipmotion", *words])
        done = run_child(["fish", "--no-config", "-c", 'source $argv[1]; complete -C "$argv[2]"', script_file, line])
        offered = {word.split("\t")[0] for word in done.stdout.splitlines()}
        assert offered == expected, words
        assert done.stderr == ""


def test_it_loads_no_numpy() -> None:
    """A shell asks for it whenever it starts."""
    asked = "main(['completion', 'bash']); sys.exit('numpy' in sys.modules)"
    program = f"import sys; from lipmotion.cli.main import main; {asked}"
    assert run_child([sys.executable, "-c", program]).returncode == 0


def test_an_unknown_shell(run: RunCommand) -> None:
    done = run("completion", "csh")
    assert (done.code, done.out) == (2, [])
    assert "invalid choice: 'csh'" in done.err[-1]
