import json
from pathlib import Path

import pytest

from cli.conftest import check_refused
from lipmotion import load_model, read_motion, speak, write
from lipmotion.extensions import install_command
from speech import stand_in_voice

pytestmark = pytest.mark.usefixtures("here")
TEXT = "Papa, see Bob."


@pytest.fixture(autouse=True)
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in_voice.install(monkeypatch)


@pytest.fixture
def basics(toy_model_file: Path) -> tuple[object, ...]:
    return ("speak", TEXT, "--model", toy_model_file)


def test_files(run, basics, here):
    names = ["a.mp4", "a.wav", "a.json", "a.csv"]
    assert run(*basics, "--fps", "5", "--rate", "50", "-o", *names) == (0, names, [])
    assert sorted(path.name for path in here.iterdir()) == sorted(names)
    motion, units = read_motion(here / "a.json")
    assert motion.rate_hz == 50
    assert [span.label.phone for span in units][:3] == ["sil", "p", "aa"]


def test_it_is_the_function_of_the_same_name(run, basics, toy_model_file, here):
    done = run(*basics, "--voice", "one", "-o", "command.json", "command.wav", "--machine-readable")
    assert json.loads(done.out[1])["stage"] == "speaking"
    model = load_model(toy_model_file)
    sound, result = speak(TEXT, voice="stand-in:one", model=model)
    (here / "function").mkdir()
    write(result, ["function/command.json", "function/command.wav"], speech=sound, model=model)
    for name in ("command.json", "command.wav"):
        assert (here / name).read_bytes() == (here / "function" / name).read_bytes()


def test_a_text_file(run, toy_model_file, here):
    (here / "text.txt").write_text("\ufeff" + TEXT, encoding="utf-8")
    assert run("speak", "--text", "text.txt", "--model", toy_model_file, "-o", "a.json").code == 0
    words = [unit.get("word") for unit in json.loads((here / "a.json").read_text())["units"]]
    assert list(dict.fromkeys(filter(None, words))) == ["papa", "see", "bob"]


def test_voices(run, basics, monkeypatch):
    done = run("speak", "--voices")
    assert [line.split() for line in done.out] == [["stand-in:one", "en-us"], ["stand-in:two", "en-us"]]
    success = json.loads(run("speak", "--voices", "--machine-readable").out[-1])
    assert success["voices"][0] == {"name": "stand-in:one", "language": "en-us"}
    stand_in_voice.install(monkeypatch, ())
    assert run("speak", "--voices") == (0, ["no voice is installed"], [])
    check_refused(run(*basics, "-o", "a.wav"), 8, f"{install_command('text')}, or: apt install stand-in")


def test_wrong_command_lines(run):
    for line, message in (
        (["speak", TEXT], "required: -o FILE, or --voices"),
        (["speak", "--voices", "-o", "a.wav"], "required: -o FILE, or --voices"),
        (["speak", "-o", "a.wav"], "required: a text, or --text FILE"),
        (["speak", TEXT, "--text", "text.txt", "-o", "a.wav"], "required: a text, or --text FILE"),
    ):
        check_refused(run(*line), 2, message)
