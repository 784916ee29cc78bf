"""Files without permission: one error line, the exit code of its kind, and no file left behind."""

import json
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
    ("lexicon.txt", 3, f"animate a.wav {MODEL} -o a.json --lexicon lexicon.txt"),
    ("u.json", 3, f"animate a.wav {MODEL} -o a.json --units u.json"),
    ("out", 7, f"animate a.wav {MODEL} -o out/a.json"),
    ("in", 3, f"animate in/a.wav {MODEL} -o a.json"),
    ("out", 7, f"cues a.wav {MODEL} -o out/a.tsv --machine-readable"),
    ("in", 3, "info in/m.lipmotion"),
    ("c", 4, "corpus info c"),
    ("c/utterances", 4, "corpus info c"),
    ("c/utterances/toy00/audio.npy", 4, "corpus info c"),
    ("r", 3, "corpus prepare r -o new --no-crops"),
    ("r/a.csv", 4, "corpus prepare r -o new --no-crops"),
    ("out", 7, "corpus prepare r -o out/new --no-crops --machine-readable"),
    ("c/utterances/toy00", 4, "train c -o m"),
    ("out", 7, "train c -o out/m"),
    ("in", 3, "train c -o m --engine coupled --recordings in"),
    ("words.txt", 4, "experiment learning-curve c --order words.txt"),
]


def ordinary() -> list[str]:
    """Return the prefix of a command that makes file modes apply to it, also if the tests run as root."""
    if os.geteuid():
        return []
    rights = "-dac_override,-dac_read_search"
    return ["setpriv", f"--bounding-set={rights}", f"--inh-caps={rights}"]


pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="modes as POSIX has them"),
    pytest.mark.skipif(
        sys.platform != "win32" and not os.geteuid() and shutil.which("setpriv") is None, reason="root, and no setpriv"
    ),
]


@pytest.fixture
def laid(here: Path, toy_corpus: Corpus, toy_model_file: Path, toy_speech: Path) -> Iterator[Path]:
    """Inputs of every kind; made readable again afterwards, so that they can be deleted."""
    for folder in (here / "out", here / "in", here / "r"):
        folder.mkdir()
        shutil.copy(toy_speech, folder / "a.wav")
    (here / "out" / "a.wav").unlink()
    (here / "r" / "a.csv").write_text("time_s,opening\n" + "".join(f"{n / 50},{n % 7 / 70}\n" for n in range(200)))
    shutil.copy(toy_speech, here / "a.wav")
    shutil.copytree(toy_corpus.path, here / "c")
    shutil.copytree(toy_corpus.path, here / "in" / "c")
    for place in (here, here / "in"):
        shutil.copy(toy_model_file, place / "m.lipmotion")
    for name in ("words.txt", "lexicon.txt", "u.json"):
        (here / name).write_text("papa")
    yield here
    for path in here.rglob("*"):
        path.chmod(0o755)


@pytest.mark.long
def test_what_may_not_be_read_or_written(laid):
    before = sorted(path.name for path in laid.iterdir())
    for closed, code, line in LINES:
        (laid / closed).chmod(0)
        try:
            ran = run_child([*ordinary(), *LIPMOTION, *line.split()])
        finally:
            (laid / closed).chmod(0o755)
        done = Done(ran.returncode, ran.stdout.splitlines(), ran.stderr.splitlines())
        if "--machine-readable" in line:
            last = json.loads((done.err if line.startswith("cues") else done.out)[-1])
            assert (done.code, last["type"]) == (code, "failure"), done
        else:
            assert is_one_error(done._replace(err=done.err[-1:]), code), done
            assert all(text.startswith("lipmotion: warning: ") for text in done.err[:-1]), done
        assert sorted(path.name for path in laid.iterdir()) == before
        assert list((laid / "out").iterdir()) == []
