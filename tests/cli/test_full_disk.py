"""A full disk, simulated by a limit on the size of files: one error line, and no partial file."""

import sys

import pytest

from children import run_child

resource = pytest.importorskip("resource")
LIMIT = 3000
pytestmark = pytest.mark.long


def run_limited(*arguments: object, limit: int = LIMIT) -> tuple[int, str]:
    code = (
        "import resource, sys\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))\n"
        "from lipmotion.cli.main import main\n"
        "sys.exit(main())\n"
    )
    done = run_child([sys.executable, "-c", code, *arguments])
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    return done.returncode, line


@pytest.mark.parametrize("name", ["a.json", "a.mp4"])
def test_animate(toy_speech, toy_model_file, here, name):
    code, line = run_limited("animate", toy_speech, "--model", toy_model_file, "-o", name, "--size", "64")
    assert (code, line.startswith(f"lipmotion: error: {name}: cannot be written: ")) == (7, True)
    assert line.endswith("; make room, then run it again")
    assert list(here.iterdir()) == []


def test_train_says_what_is_kept_and_goes_on(run_outside, toy_corpus, here):
    train = ("train", toy_corpus.path, "--engine", "joint", "--set", "mixtures=1")
    code, line = run_limited(*train, "-o", "m.lipmotion", limit=30_000)  # phones, not the model
    assert (code, "cannot be written: " in line) == (7, True)
    assert "make room, then run it again; what is finished is kept in m.lipmotion.unfinished" in line
    left = [str(path.relative_to(here)) for path in here.rglob("*") if path.is_file()]
    assert not [path for path in left if ".part-" in path]
    assert run_outside(*train, "-o", "m.lipmotion").code == 0
    run_outside(*train, "-o", "whole.lipmotion")
    assert (here / "m.lipmotion").read_bytes() == (here / "whole.lipmotion").read_bytes()
