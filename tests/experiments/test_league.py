"""Rivals on the same recordings: those that answer, and those that are absent, crash, hang or answer nonsense."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import Corpus
from lipmotion.errors import CorpusError, InputError
from lipmotion.types import Channel, Motion, Track
from lipmotion_lab.league import League, Rival, count_closings, load_recordings, read_rivals, run_rivals, write_league

ADAPTERS = Path(__file__).parents[2] / "extras" / "league"
STANDIN = """
import json, sys, time
job, truth = json.load(open(sys.argv[1])), json.load(open(__file__.replace("standin.py", "truth.json")))
open(__file__.replace("standin.py", "calls.txt"), "a").write("x")
answers = {}
for row in job["recordings"]:
    answers[row["name"]] = []
    for settings in job["settings"]:
        does, times = settings["does"], [t + settings.get("late", 0) for t in truth[row["name"]]["times"]]
        weights = {name: [0.5 - value for value in truth[row["name"]][name]] for name in ("opening", "width")}
        weights = {f"minus {name}": values for name, values in weights.items()}
        if does == "crash": raise ValueError("no such voice")
        if does == "hang": time.sleep(600)
        if does == "absent": sys.exit(8)
        if does == "nan": weights["minus width"][3] = float("nan")
        if does == "early": times = [t / 9 for t in times]
        if does == "backwards": times = times[::-1]
        if does == "short": weights["minus width"].pop()
        if does == "renames": weights = {row["name"]: weights["minus width"]}
        if does == "noise": weights = {"noise": [(n * 7919) % 13 for n in range(len(times))]}
        if does == "told": assert row["phones"]
        answers[row["name"]].append({"times": times, "weights": weights, "seconds": 0.5})
    if does == "forgets": answers.pop(row["name"])
json.dump(answers, open(sys.argv[2], "w"))
"""


@pytest.fixture
def adapters(tmp_path: Path, toy_corpus: Corpus) -> Path:
    folder = tmp_path / "adapters"
    folder.mkdir()
    truth = {}
    for name in toy_corpus.names():
        motion = toy_corpus.utterance(name).track.motion
        rows = {channel: motion[channel].tolist() for channel in ("opening", "width")}
        truth[name] = rows | {"times": motion.time_s.tolist()}
    (folder / "truth.json").write_text(json.dumps(truth))
    (folder / "standin.py").write_text(STANDIN)
    return folder


def hold(adapters: Path, corpus: Corpus, rows: dict[str, dict[str, Any]], **options: Any) -> League:
    python = {"run": ["{NOT_SET:python}", "standin.py"], "needs": "install it"}
    table = {name: {"title": name.upper(), **python, **row} for name, row in rows.items()}
    (adapters / "rivals.json").write_text(json.dumps(table))
    return run_rivals(corpus, adapters, adapters.parent / "work", **options)


def does(*what: str, **more: Any) -> dict[str, Any]:
    return {"settings": {"does": list(what)}, **more}


@pytest.mark.long
def test_the_best_settings_map_and_lag_are_chosen_on_other_recordings(adapters, toy_corpus, tmp_path):
    late = {"settings": {"does": ["noise", "told"], "late": [0.08]}, "given": "phones"}
    rows = {"late": late, "noise": does("noise"), "ours": does("follows", ours=True)}
    found = hold(adapters, toy_corpus, rows, sync_s=0.0)
    by_name = {each.rival.name: each for each in found.standings}
    assert list(by_name)[-1] == "noise"
    assert by_name["late"].figures["acc"].value > 0.9
    assert by_name["ours"].figures["width"].value > 0.95
    assert by_name["late"].chosen[0]["settings"] == {"does": "told", "late": 0.08}
    assert by_name["late"].chosen[0]["lag_ms"] == 80
    assert len(by_name["late"].chosen) == 1  # the list val, and test is reported
    assert by_name["late"].figures["strength"].value == pytest.approx(1, abs=0.2)
    figures = write_league(found, tmp_path / "report")
    assert figures["best_rival"] == "NOISE"  # the others are ours, or are told phones
    assert figures["rivals"]["OURS"]["acc_gain_95"][0] > 0
    page = (tmp_path / "report" / "index.html").read_text()
    assert all(title in page for title in ("LATE", "NOISE", "OURS"))
    assert (tmp_path / "report" / "league" / "3.png").stat().st_size > 1000
    assert json.loads((tmp_path / "report" / "league" / "figures.json").read_text()) == json.loads(json.dumps(figures))


def test_answers_are_kept_and_what_one_rival_lacks_stops_no_other(adapters, toy_corpus, monkeypatch):
    monkeypatch.delenv("NOT_SET", raising=False)
    gone = {"run": ["/no/such/program", "standin.py"], "needs": "put it on the PATH"}
    unset = {"settings": {"model": ["$NOT_SET/a.model"]}}
    rows = {"good": does("follows"), "absent": does("absent"), "gone": does("follows") | gone, "unset": unset}
    rows |= {"crash": does("crash"), "nan": does("nan"), "early": does("early"), "backwards": does("backwards")}
    rows |= {name: does(name) for name in ("short", "forgets", "renames")}
    found = hold(adapters, toy_corpus, rows)
    assert [each.rival.name for each in found.standings] == ["good"]
    assert set(found.absent) == {"ABSENT", "GONE", "UNSET"}
    assert "put it on the PATH" in found.absent["GONE"]
    assert "no such voice" in found.failed["CRASH"]
    for name, words in (("NAN", "not readable"), ("EARLY", "times from"), ("BACKWARDS", "times from"),
                        ("SHORT", "weights"), ("FORGETS", "no list of 1"), ("RENAMES", "different names")):  # fmt: skip
        assert words in found.failed[name] or "no readable" in found.failed[name]
    (adapters / "calls.txt").unlink()
    again = hold(adapters, toy_corpus, {"good": does("follows")})
    assert not (adapters / "calls.txt").exists()
    assert again.standings[0].figures["acc"].value == pytest.approx(found.standings[0].figures["acc"].value)
    hung = hold(adapters, toy_corpus, {"hangs": does("hang")}, limit_s=1.0)
    assert ("after 1 s" in hung.failed["HANGS"], hung.standings) == (True, [])
    assert write_league(hung, adapters.parent / "report")["best_rival"] is None


@pytest.mark.long
def test_what_cannot_be_compared(adapters, toy_corpus, tmp_path):
    with pytest.raises(InputError, match="extras/league"):
        read_rivals(tmp_path / "nowhere")
    (tmp_path / "rivals.json").write_text('{"one": {"run": 3}}')
    with pytest.raises(InputError, match="not a table"):
        read_rivals(tmp_path)
    options = {"choosing": toy_corpus, "only": ["other"], "sync_s": -0.01, "limit_s": 0.0}
    words = ("to choose on and is reported", "no rival 'other'", "-10 ms, .* 0 to 5000 ms", "0 s for a rival")
    for (name, value), message in zip(options.items(), words, strict=True):
        with pytest.raises(InputError, match=message):
            hold(adapters, toy_corpus, {"good": does("follows")}, **{name: value})
    single = toy_corpus.divided({"train": toy_corpus.names("train")[:1]})
    with pytest.raises(InputError, match="two or more"):
        hold(adapters, single, {"good": does("follows")})
    unmeasured = Corpus.create(tmp_path / "unmeasured")
    utterance = toy_corpus.utterance(toy_corpus.names("train")[0])
    motion = Motion(np.zeros((50, 1)), 25.0, (Channel("outer"),))
    track = Track(motion, np.ones(50, bool))
    unmeasured.add(type(utterance)(**{**utterance.__dict__, "track": track}))
    with pytest.raises(CorpusError, match="no opening, width"):
        hold(adapters, unmeasured, {"good": does("follows")})


def test_closings_of_the_lips(toy_corpus, tmp_path):
    recording = load_recordings(toy_corpus, toy_corpus.names("test")[:1], tmp_path, lambda _: None)[0]
    shut = 0.1 * float(np.percentile(recording.original[:, 0], 95))
    everything, lips = count_closings(recording, recording.original, shut)
    assert everything[1:].tolist() == lips[1:].tolist() == [0, 0]
    still = np.zeros_like(recording.original)
    assert count_closings(recording, still, shut)[0][0] == 0  # a mouth that never opens closes nowhere


ONNX = """
import numpy as np
class SessionOptions: pass
class InferenceSession:
    def __init__(self, path, options, providers): assert path.endswith("network.onnx")
    def run(self, outputs, given):
        sound, emotion = given["input"], given["emotion"]
        assert sound.shape[1:] == (1, 8320) and emotion.shape == (len(sound), 1, 26) and sound.dtype == np.float32
        loudness = np.square(sound[:, :, 4000:4320]).mean(axis=2, keepdims=True)
        return [loudness * np.arange(301)]
"""


def test_audio2face_is_asked_as_its_network_wants(toy_corpus, tmp_path, monkeypatch):
    (tmp_path / "onnxruntime.py").write_text(ONNX)  # a stand-in: the network is not to be had here
    (tmp_path / "network.onnx").touch()
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]))
    monkeypatch.setenv("LIPMOTION_AUDIO2FACE", str(tmp_path))
    found = run_rivals(toy_corpus, ADAPTERS, tmp_path / "work", only=["audio2face"])
    assert (found.failed, found.absent) == ({}, {})
    (tmp_path / "network.onnx").unlink()
    absent = run_rivals(toy_corpus, ADAPTERS, tmp_path / "other", only=["audio2face"]).absent
    assert "network.onnx" in absent["Audio2Face-3D"]


@pytest.mark.long
def test_our_own_adapter_answers(toy_corpus, tmp_path):
    found = run_rivals(toy_corpus, ADAPTERS, tmp_path, only=["lipmotion"])
    assert not found.failed
    assert not found.absent
    assert np.isfinite(found.standings[0].figures["acc"].value)


def test_the_table_of_rivals_is_whole():
    rivals = read_rivals(ADAPTERS)
    assert len(rivals) > 8
    for rival in rivals:
        assert (ADAPTERS / rival.run[1]).is_file()
        assert isinstance(rival, Rival)
        assert rival.needs
