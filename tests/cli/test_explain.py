import json

import pytest

from cli.conftest import check_refused

pytestmark = pytest.mark.usefixtures("here")


def test_several_times_and_any_engine(run, toy_model_file, toy_speech):
    done = run("explain", toy_model_file, toy_speech, "--at", "0.8", "--at", "0.5")
    assert [line for line in done.out if line and not line.startswith(" ")] == [
        "0.80 s (frame 80)",
        "0.50 s (frame 50)",
    ]


def test_for_machines(run, coupled_model_file, toy_speech):
    done = run("explain", coupled_model_file, toy_speech, "--at", "0.8", "--at", "0.5", "--json")
    assert [json.loads(line)["frame"] for line in done.out] == [80, 50]


def test_what_cannot_be_explained(run, coupled_model_file, toy_speech):
    for options, code, words in (
        ([coupled_model_file, toy_speech, "--at=-1"], 3, "-1.0 s lies outside the recording (0 to "),
        ([coupled_model_file, toy_speech, "--at", "nan"], 3, "nan s lies outside the recording"),
        (["missing", toy_speech, "--at", "1"], 3, "missing: no such model"),
        ([coupled_model_file, "missing.wav", "--at", "1"], 3, "missing.wav: no such file"),
        ([toy_speech, coupled_model_file, "--at", "1"], 6, "not a lipmotion model"),
    ):
        check_refused(run("explain", *options), code, words)


def test_without_a_time_all_states_are_listed(run, toy_model_file, toy_speech):
    listed = run("explain", toy_model_file, toy_speech)
    documents = [json.loads(line) for line in run("explain", toy_model_file, toy_speech, "--json").out]
    assert (listed.code, listed.err) == (0, [])
    assert listed.out[0].split() == ["from", "to", "phone", "word", "state"]
    assert [line[:8].strip() for line in listed.out[1:]] == [f"{document['start_s']:.2f}" for document in documents]
    assert {document["state"] for document in documents} >= {"rest"}
    few = run("explain", toy_model_file, toy_speech, "--count", "2")
    assert few.out[1:3] == listed.out[1:3]
    assert few.out[3] == f"and {len(documents) - 2} more (--count N prints N, --json all)"


def test_without_a_model_it_is_the_shipped_one_and_the_former_order_is_understood(run, toy_model_file, toy_speech):
    shipped, named, former = (
        run("explain", *order, "--at", "0.5")
        for order in ([toy_speech], [toy_speech, "--model", toy_model_file], [toy_model_file, toy_speech])
    )
    assert shipped.code == named.code == former.code == 0
    assert former.out == named.out != shipped.out
