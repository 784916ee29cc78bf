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


def test_a_film(toy_speech, toy_model_file, filmed_face_file, here):
    basics = ("animate", toy_speech, "--model", toy_model_file, "--face", filmed_face_file)
    code, line = run_limited(*basics, "-o", "a.mp4", limit=20_000)
    assert (code, line.startswith("lipmotion: error: a.mp4: cannot be written: ")) == (7, True)
    assert list(here.iterdir()) == []


def test_a_face(filmed_face_file, here):
    code = (
        "import resource, sys\n"
        "from lipmotion.errors import ExportError\n"
        "from lipmotion_faces.filmed.face import load_face, save_face\n"
        "face = load_face(sys.argv[1])\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "try:\n"
        "    save_face(face, 'a.face')\n"
        "except ExportError as error:\n"
        "    print(error)\n"
    )
    done = run_child([sys.executable, "-c", code, filmed_face_file])
    assert done.stderr == ""
    assert done.stdout.startswith("a.face: cannot be written: ")
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


def test_a_report_says_so_before_the_work(toy_corpus, here):
    code, line = run_limited("experiment", "all", toy_corpus.path, "-o", "r", "--quick")
    assert (code, line.startswith("lipmotion: error: r/index.html: cannot be written: ")) == (7, True)
    assert line.endswith("; make room, then run it again")
    assert list((here / "r").iterdir()) == []
