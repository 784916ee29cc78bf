from __future__ import annotations

import sys

import pytest

from children import PIPE, child
from cli.conftest import RunCommand
from lipmotion.cli import info, main
from lipmotion.errors import AlignmentError, LipMotionError, MissingDependencyError

STOPPED = "lipmotion: stopped; run the same command again to go on"
VERBS = ["animate", "corpus", "train", "evaluate", "info"]


def test_help_lists_verbs_and_exit_codes(run: RunCommand) -> None:
    done = run("--help")
    assert (done.code, done.err) == (0, [])
    text = " ".join(" ".join(done.out).split())
    for verb in VERBS:
        assert f" {verb} " in text
    assert "0 done, 1 a bug, 2 wrong command line, 3 unusable input, 4 corpus, 5 alignment, 6 model file" in text


@pytest.mark.parametrize("verb", [*VERBS, "corpus prepare", "corpus info"])
def test_every_verb_has_help(run: RunCommand, verb: str) -> None:
    done = run(*verb.split(), "--help")
    assert (done.code, done.err) == (0, [])
    assert done.out[0].startswith(f"usage: lipmotion {verb} ")


def test_the_version(run: RunCommand) -> None:
    from importlib.metadata import version

    assert run("--version") == (0, [f"lipmotion {version('lipmotion')}"], [])


@pytest.mark.parametrize("arguments", [[], ["bogus"], ["corpus"], ["corpus", "bogus"], ["--bogus"], ["train"]])
def test_a_wrong_command_line(run: RunCommand, arguments: list[str]) -> None:
    done = run(*arguments)
    assert (done.code, done.out) == (2, [])
    assert "error: " in done.err[-1]


@pytest.mark.parametrize(
    ("misspelt", "hint"),
    [
        (["animate", "a.wav", "-o", "a.json", "--fase", "woman"], "--fase woman; did you mean --face?"),
        (["face", "build", "a.mp4", "-o", "a.face", "--speker=x"], "--speker=x; did you mean --speaker?"),
        (["info", "--zzz"], "--zzz; see: lipmotion info --help"),
    ],
)
def test_a_misspelt_option(run: RunCommand, misspelt: list[str], hint: str) -> None:
    done = run(*misspelt)
    assert done.code == 2
    assert done.err[-1] == f"lipmotion: error: unrecognized arguments: {hint}"


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (LipMotionError("what"), 1, "lipmotion: error: what"),
        (AlignmentError("two\n  lines"), 5, "lipmotion: error: two\\n  lines"),
        (MissingDependencyError("pip install it"), 8, "lipmotion: error: pip install it"),
        (
            PermissionError(13, "Permission denied", "a.json"),
            3,
            "lipmotion: error: [Errno 13] Permission denied: 'a.json'",
        ),
        (KeyboardInterrupt(), 130, STOPPED),
    ],
)
def test_an_error_is_one_line(
    run: RunCommand, monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int, line: str
) -> None:
    def fail(_: object) -> None:
        raise error

    monkeypatch.setattr(info, "run", fail)
    assert run("info") == (code, [], [line])


def test_a_bug_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(info, "run", fail)
    with pytest.raises(ZeroDivisionError):
        main.main(["info"])


@pytest.mark.parametrize("arguments", [["info"], ["--help"], ["--version"]])
def test_a_reader_that_has_gone_is_no_error(arguments: list[str]) -> None:
    """As in ``lipmotion info | head -0``: the output is buffered, so it is found at the very end."""
    program = [
        sys.executable,
        "-c",
        "import sys; sys.stdin.read(); from lipmotion.cli.main import main; sys.exit(main())",
    ]
    with child([*program, *arguments], stdin=PIPE, stderr=PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        process.stdin.close()  # now it may begin
        assert process.stderr.read() == ""
        assert process.wait() == 0
