import json
from pathlib import Path

import pytest

pytestmark = pytest.mark.usefixtures("here")


def test_several_times_and_any_engine(run, toy_model_file, coupled_model_file, toy_speech):
    done = run("explain", toy_speech, "--model", toy_model_file, "--at", "0.8", "--at", "0.5")
    frames = [line for line in done.out if line and not line.startswith(" ")]
    assert frames == ["0.80 s (frame 80)", "0.50 s (frame 50)"]
    done = run("explain", toy_speech, "--model", coupled_model_file, "--at", "0.8", "--at", "0.5", "--json")
    assert [json.loads(line)["frame"] for line in done.out] == [80, 50]


def test_without_a_time_all_states_are_listed(run, toy_model_file, toy_speech):
    listed = run("explain", toy_speech, "--model", toy_model_file)
    documents = [json.loads(line) for line in run("explain", toy_speech, "--model", toy_model_file, "--json").out]
    assert (listed.code, listed.err, listed.out[0].split()) == (0, [], ["from", "to", "phone", "word", "state"])
    assert [line[:8].strip() for line in listed.out[1:]] == [f"{document['start_s']:.2f}" for document in documents]
    assert {document["state"] for document in documents} >= {"rest"}
    few = run("explain", toy_speech, "--model", toy_model_file, "--count", "2")
    assert few.out[1:] == [*listed.out[1:3], f"and {len(documents) - 2} more (--count N prints N, --json all)"]


@pytest.mark.parametrize("words", ["explain SPEECH --at 0.5", "cues SPEECH -o a.tsv", "edit a.json --of SPEECH"])
def test_a_terminal_shows_how_far_the_work_is(words, run, toy_model_file, toy_speech, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    done = run(*(toy_speech if word == "SPEECH" else word for word in words.split()), "--model", toy_model_file)
    assert "moving the mouth (1/1)" in "".join(done.err)


@pytest.mark.long
def test_without_a_model_it_is_the_shipped_one(run, toy_model_file, toy_speech):
    shipped = run("explain", toy_speech, "--at", "0.5")
    named = run("explain", toy_speech, "--model", toy_model_file, "--at", "0.5")
    assert shipped.code == named.code == 0
    assert named.out != shipped.out


WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"
SAID = "please speak and my lips will move five big blue boats float by"


@pytest.mark.long
def test_words_are_written_and_given_back(run, here):
    assert run("words", WELCOME, "-o", "said.txt", "said.json") == (0, ["said.txt", "said.json"], [])
    assert (here / "said.txt").read_text() == SAID + "\n"
    done = run("animate", WELCOME, "--transcript", "said.json", "-o", "motion.json")
    assert (done.code, done.out) == (0, ["motion.json"])
    units = json.loads((here / "motion.json").read_text())["units"]
    assert list(dict.fromkeys(unit["word"] for unit in units if unit.get("word"))) == SAID.split()


@pytest.mark.long
def test_for_people_and_programs(run):
    assert run("words", WELCOME) == (0, [SAID], [])
    done = run("words", WELCOME, "--machine-readable")
    start, *progress, success = map(json.loads, done.out)
    assert (start["type"], progress[0]["value"], success["type"]) == ("start", 0.0, "success")
    assert " ".join(word["word"] for word in success["words"]) == SAID
    assert 0 < success["confidence"] < 1
