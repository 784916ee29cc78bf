"""Files without permission: one error line, the exit code of its kind, and no file left behind."""

import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from children import LIPMOTION, run_child
from cli.conftest import Done, is_one_error
from lipmotion import Corpus

MODEL = "--model m.lipmotion --recogniser own"
LINES = [
    # the path without permission, the exit code, and the command line
    ("a.wav", 3, f"animate a.wav {MODEL} -o a.json"),
    ("m.lipmotion", 6, f"animate a.wav {MODEL} -o a.json"),
    ("words.txt", 3, f"animate a.wav {MODEL} -o a.json --transcript words.txt"),
    ("out", 7, f"animate a.wav {MODEL} -o out/a.json"),
    ("in", 3, "info in/m.lipmotion"),
    ("c/utterances", 4, "corpus info c"),
    ("in", 3, "corpus prepare in -o new --no-crops"),
    ("c/utterances/toy00", 4, "train c -o m"),
    ("out", 7, "train c -o out/m"),
]


def ordinary() -> list[str]:
    """Return the prefix of a command that makes file modes apply to it, also if the tests run as root."""
    rights = "-dac_override,-dac_read_search"
    return ["setpriv", f"--bounding-set={rights}", f"--inh-caps={rights}"] if not os.geteuid() else []


@pytest.fixture
def laid(here: Path, toy_corpus: Corpus, toy_model_file: Path, toy_speech: Path) -> Iterator[Path]:
    """Inputs of several kinds; made readable again afterwards, so that they can be deleted."""
    (here / "out").mkdir()
    shutil.copytree(toy_corpus.path, here / "c")
    (here / "in").mkdir()
    for place in (here, here / "in"):
        shutil.copy(toy_speech, place / "a.wav")
        shutil.copy(toy_model_file, place / "m.lipmotion")
    (here / "words.txt").write_text("papa")
    yield here
    for path in here.rglob("*"):
        path.chmod(0o755)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="modes as POSIX has them")
def test_what_may_not_be_read_or_written(laid):
    if ordinary() and shutil.which("setpriv") is None:
        pytest.skip("root, and no setpriv")
    before = sorted(laid.rglob("*"))
    for closed, code, line in LINES:
        (laid / closed).chmod(0)
        ran = run_child([*ordinary(), *LIPMOTION, *line.split()])
        (laid / closed).chmod(0o755)
        *warnings, error = ran.stderr.splitlines()
        assert is_one_error(Done(ran.returncode, ran.stdout.splitlines(), [error]), code), (line, ran)
        assert all(text.startswith("lipmotion: warning: ") for text in warnings), (line, ran)
        assert sorted(laid.rglob("*")) == before
