import json
from pathlib import Path

import pytest

pytestmark = pytest.mark.usefixtures("here")
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"
SAID = "please speak and my lips will move five big blue boats float by"


def test_words_are_written_and_given_back(run, here):
    assert run("words", WELCOME, "-o", "said.txt", "said.json") == (0, ["said.txt", "said.json"], [])
    assert (here / "said.txt").read_text() == SAID + "\n"
    done = run("animate", WELCOME, "--transcript", "said.json", "-o", "motion.json")
    assert (done.code, done.out) == (0, ["motion.json"])
    units = json.loads((here / "motion.json").read_text())["units"]
    assert list(dict.fromkeys(unit["word"] for unit in units if unit.get("word"))) == SAID.split()


def test_for_people_and_programs(run):
    assert run("words", WELCOME) == (0, [SAID], [])
    done = run("words", WELCOME, "--machine-readable")
    start, success = map(json.loads, done.out)
    assert (start["type"], success["type"]) == ("start", "success")
    assert " ".join(word["word"] for word in success["words"]) == SAID
    assert success["word_s"] > success["phone_s"]
    assert 0 < success["confidence"] < 1
