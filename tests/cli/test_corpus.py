import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import check_refused, is_one_error
from lipmotion.formats.sound import write_sound
from lipmotion.pipeline.outputs.motion_files import read_generation
from lipmotion.pipeline.training.prompts import prompts
from lipmotion.types import Item, Progress
from lipmotion_faces.corpus import prepare
from lipmotion_faces.corpus import sync as offset
from lipmotion_faces.corpus.coverage import coverage
from lipmotion_faces.corpus.prepare import PrepareReport
from speech.recorded_twice import RATE_HZ, clap, recorded_twice, speech_like


def test_info(run, toy_corpus):
    done = run("corpus", "info", toy_corpus.path)
    assert (done.code, done.err) == (0, [])
    summary = dict(line.split(maxsplit=1) for line in done.out)
    assert summary["utterances"] == "12 (8 train, 2 val, 2 test)"
    assert summary["transcribed"] == "12"
    assert summary["offset"].startswith("toy: ") or summary["offset"].startswith("corpus: ")


def test_motion_that_was_tracked_is_written_as_files(run, toy_corpus, here):
    done = run("corpus", "motion", toy_corpus.path, "-o", "natural", "--channels", "width,opening")
    assert done == (0, ["natural: the motion of 2 recordings"], [])
    for name in toy_corpus.names("test"):
        tracked, motion = toy_corpus.utterance(name).track.motion, read_generation(f"natural/{name}.json").motion
        assert (motion.names, motion.rate_hz) == (("width", "opening"), tracked.rate_hz)
        assert motion.values == pytest.approx(tracked.selected(("width", "opening")).values, abs=1e-4)
    check_refused(run("corpus", "motion", toy_corpus.path, "-o", "other", "--channels", "pucker"), 3, "pucker")
    assert not (here / "other").exists()


def test_sync(run, toy_corpus, here, monkeypatch):
    shutil.copytree(toy_corpus.path, here / "mine")
    monkeypatch.setattr(offset, "sync", lambda _corpus: {"studio": 0.12})
    assert run("corpus", "sync", "mine") == (0, ["studio: sound moved by -120 ms"], [])
    monkeypatch.setattr(offset, "sync", lambda _corpus: {})
    assert run("corpus", "sync", "mine").out == [
        "mine: nothing moved: the sound is in step, or its offset could not be measured"
    ]
    assert is_one_error(run("corpus", "sync", "missing"), 4)


EVENTS = (Item("a", "prepared"), Progress("preparing recordings", 1, 2, 0.5), Item("d", "skipped", "no face"))


def test_prepare_prints_the_counts(run, monkeypatch):
    asked: dict[str, object] = {}

    def done(directory: Path, output: Path, **options: object) -> PrepareReport:
        monitor = options.pop("monitor")
        assert callable(monitor)
        for event in EVENTS:
            monitor(event)
        asked.update(options, directory=directory, output=output)
        return PrepareReport(
            output, "folder of videos", ("a", "b"), ("c",), {"d": "no face"}, {"a": 3}, 1.0, {"b": ("cut at 1.00 s",)}
        )

    monkeypatch.setattr(prepare, "prepare", done)
    arguments = ("videos", "-o", "mine", "--workers", "2", "--no-crops", "--offset-ms", "-40")
    assert run("corpus", "prepare", *arguments) == (
        0,
        ["mine: 2 prepared, 1 kept, 1 skipped (folder of videos)"],
        ["lipmotion: warning: skipped d: no face"],
    )
    assert asked == {
        "directory": Path("videos"), "output": Path("mine"), "workers": 2, "crops": False, "offset_ms": -40.0,
    }  # fmt: skip


def test_coverage(run, toy_corpus):
    done = run("corpus", "coverage", toy_corpus.path, "--count", "3")
    assert (done.code, done.err) == (0, [])
    found = coverage(toy_corpus)
    assert done.out[0] == f"{len(toy_corpus)} of {len(toy_corpus)} utterances, {found.sentences} sentences"
    for line, kind in zip(done.out[1:4], found.kinds, strict=True):
        assert line.split()[:4] == [kind.kind, str(kind.covered), "of", str(kind.needed)]
    assert f"and {len(found.kinds[1].missing) - 3} more diphones" in done.out


def test_prompts(run, here, toy_corpus):
    done = run("corpus", "prompts", "--count", "3")
    found = prompts(count=3)
    assert (done.code, done.err) == (0, [])
    assert [line.split(None, 5)[5] for line in done.out[:3]] == [prompt.text for prompt in found.chosen]
    last = found.chosen[-1]
    assert f"phones {last.phones}/{found.phones}  diphones {last.diphones:4}/{found.diphones}" in done.out[2]
    share = last.diphones / found.diphones
    assert done.out[3].startswith(f"3 of {found.sentences} sentences: {share:.0%} of all their diphones")
    (here / "mine.txt").write_text(" ".join(toy_corpus.utterance("toy00").words or ()))
    done = run("corpus", "prompts", "--text", "mine.txt", "--have", toy_corpus.path)
    assert (done.code, done.out) == (0, ["0 of 1 sentences: they add nothing"])


def test_texts_and_lexicons_of_ones_own(run, here, toy_corpus):
    (here / "mine.txt").write_text("Two qwrtzx.\nFive.\nPapa vxvx.\n")
    (here / "lexicon.txt").write_text("qwrtzx zh oy\n")
    own = ("--text", "mine.txt", "--lexicon", "lexicon.txt")
    done = run("corpus", "prompts", *own, "--have", toy_corpus.path)
    assert done.out[0].endswith("Two qwrtzx.")
    assert done.err == ["lipmotion: warning: left out 1 sentences for their words: vxvx"]
    given = ["corpus", "coverage", toy_corpus.path, *own]
    done = run(*given)
    assert done.err == ["lipmotion: warning: left out 1 sentences for their words (--json has them)"]
    assert [line for line in done.out if line.startswith("zh ")]
    done = run(*given, "--json")
    assert done.err == []
    (document,) = map(json.loads, done.out)
    assert document["left_out"] == {"Papa vxvx.": "vxvx"}
    assert [kind["kind"] for kind in document["kinds"]] == ["phones", "diphones", "triphones"]


def test_offset_of_two_recordings(run, here):
    chance = np.random.default_rng(5)
    scene = np.concatenate([np.zeros(RATE_HZ), speech_like(chance, 3.0)])
    made = clap(chance)
    scene[RATE_HZ // 2 :][: len(made)] += made
    camera, recorder, _ = recorded_twice(scene, chance, 800, 7_200)
    write_sound(here / "camera.wav", camera)
    write_sound(here / "recorder.wav", recorder)
    done = run("corpus", "offset", "camera.wav", "recorder.wav")
    assert done.code == 0
    assert done.out[0].startswith("--offset-ms 500.0  (by clap; levels correlate by 0.")
