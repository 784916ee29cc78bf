import json
import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from children import wait_until
from lipmotion import Corpus, Model, errors, load_model
from testing.toy import ToySentence

pytest.importorskip("starlette", reason="the extra 'studio' is not installed")

from lipmotion_studio.folder import ProjectFolder
from lipmotion_studio.trainer import TRAINING, Trainer
from lipmotion_studio.training import TrainingOrder, VoiceOptions, run_training, split_names
from studio.open_studio import OpenStudio, open_studio
from studio.toy_recordings import SENTENCES, write_recordings

OPTIONS = {"prior": False}


@pytest.fixture
def studio(toy_speech: Path, toy_sentence: ToySentence, toy_model: Model, tmp_path: Path) -> Iterator[OpenStudio]:
    """A studio with a line, and a folder of recordings that a voice can be trained on."""
    recordings = write_recordings(tmp_path / "recordings")
    with open_studio(toy_speech, " ".join(toy_sentence.words), toy_model, tmp_path / "studio") as opened:
        opened.folder.change(
            lambda project: replace(project, recordings=os.path.relpath(recordings, opened.folder.path))
        )
        yield opened


def job(studio: OpenStudio) -> dict[str, Any]:
    return dict(studio.ask("/api/training").content["job"])


def ended(studio: OpenStudio) -> dict[str, Any]:
    wait_until(lambda: job(studio)["state"] != "working" and studio.studio.trainer._thread is None)
    return job(studio)


@pytest.mark.long
def test_a_voice_is_trained_measured_used_and_taken_back(studio):
    state = studio.ready()
    studio.edit("phone 3 is p")
    studio.ask("/api/lines/1/export", {"files": [".csv"]})
    before = studio.ask("/api/lines/1/motion").body
    begun = studio.ask("/api/training", {"kind": "voice", "name": "Me", "options": OPTIONS})
    assert (begun.status, begun.content["job"]["state"], begun.content["job"]["name"]) == (201, "working", "Me")
    refused = studio.ask("/api/training", {"kind": "face", "name": "me"})
    assert (refused.status, "wait for it" in refused.content["error"]) == (422, True)
    shares = set()

    def watched() -> bool:
        told = studio.ask("/api/progress").content["training"]
        shares.add(told["share"])
        assert studio.ask("/api/lines/1/why?time=0.5").status == 200  # the page is answered meanwhile
        return bool(told["state"] != "working")

    wait_until(watched)
    told = ended(studio)
    assert told["error"] == ""
    assert len(shares) > 2
    report = told["report"]
    assert (report["learned"], report["kept_back"], report["skipped"]) == (SENTENCES - 1, 1, 1)
    assert [each["name"] for each in told["skipped"]] == ["empty"]
    assert {row["condition"] for row in report["figures"]} == {"audio only", "with transcript"}
    assert "split given names: 1 clips" in report["table"]
    assert [path.name for path in (studio.folder.path / "voices").iterdir()] == ["Me.lipmotion"]
    assert load_model(studio.folder.path / report["file"]).about["utterances"] == SENTENCES - 1

    revision = studio.ask("/api/training").content["revision"]
    assert studio.ask("/api/voice", {"voice": "../Me", "revision": revision}).status == 422
    used = studio.ask("/api/voice", {"voice": "Me", "revision": revision}).content["voices"]
    assert [voice["name"] for voice in used if voice["used"]] == ["Me"]
    after = studio.ready()
    assert (after["steps"], after["phones"][4:]) == (["phone 3 is p"], state["phones"][4:])
    assert studio.ask("/api/lines/1/motion").body != before
    assert studio.row()["exported"] == "changed"
    assert studio.folder.project.model == "voices/Me.lipmotion"


@pytest.mark.long
def test_what_is_stopped_or_killed_goes_on(studio):
    assert studio.ask("/api/training/again", {}).status == 422
    studio.ask("/api/training", {"kind": "voice", "name": "me", "options": OPTIONS})
    wait_until(lambda: job(studio)["share"] > 0)
    assert studio.ask("/api/training/stop", {}).content["job"]["state"] == "stopped"
    assert studio.ask("/api/training/again", {}).content["job"]["state"] == "working"
    wait_until(lambda: job(studio)["share"] > 0.6)  # the recordings are prepared
    process = studio.studio.trainer._process
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    told = ended(studio)
    assert (told["state"], "run it again" in told["error"]) == ("failed", True)
    assert not (studio.folder.path / told["file"]).exists()

    studio.ask("/api/training/again", {})
    wait_until(lambda: job(studio)["share"] > 0.6)
    studio.studio.trainer.close()  # as where the studio ends meanwhile
    found = Trainer(studio.folder)  # as where it is opened again
    assert (found.describe()["state"], found.describe()["name"]) == ("interrupted", "me")
    kept = Corpus.open(studio.folder.path / TRAINING / "corpus").names()
    assert set(kept) == {f"toy{number:02d}" for number in range(SENTENCES)}
    found.retry()
    wait_until(lambda: not found.is_working and found._thread is None)
    assert (found.describe()["state"], found.describe()["report"]["file"]) == ("done", "voices/me.lipmotion")
    assert not list((studio.folder.path / "voices").glob("*.unfinished"))


REFUSED = json.loads(Path(__file__).with_name("refused_training.json").read_text(encoding="utf-8"))


def test_what_cannot_be_made_is_refused(studio):
    for content, said in REFUSED:
        reply = studio.ask("/api/training", content)
        assert (reply.status, said in reply.content["error"]) == (422, True), reply.content
    assert studio.ask("/api/training").content["job"] is None
    studio.folder.change(lambda project: replace(project, recordings=""))
    reply = studio.ask("/api/training", {"kind": "face", "name": "a"})
    assert (reply.status, "--recordings" in reply.content["error"]) == (422, True)
    assert not (studio.folder.path / TRAINING).exists()


def test_videos_of_the_project_are_gathered_with_their_words(tmp_path):
    """What the readers refuse is told as a sentence, and nothing is left of what was gathered."""
    from lipmotion_studio.training import TrainingRecording, open_recordings

    for name in ("take.mp4", "take.srt", "other.mp4"):
        (tmp_path / name).write_text(name, encoding="utf-8")
    lines = (
        TrainingRecording(tmp_path / "take.mp4", "a/take", ""),
        TrainingRecording(tmp_path / "take.mp4", "a-take", "so typed"),
        TrainingRecording(tmp_path / "other.mp4", "other", ""),
    )
    order = TrainingOrder("voice", tmp_path / "me.lipmotion", tmp_path / "work", lines, VoiceOptions(), None, 1)
    with open_recordings(order) as place:
        found = {path.name: path.read_text(encoding="utf-8") for path in place.iterdir()}
    assert found == {
        "a-take.mp4": "take.mp4", "a-take.srt": "take.srt", "a-take-2.mp4": "take.mp4", "a-take-2.txt": "so typed",
        "other.mp4": "other.mp4",
    }  # fmt: skip
    reports: list[Any] = []
    run_training(order, reports.append)
    assert list(reports[-1]) == ["error"]
    assert not order.target.exists()
    assert not any(path.is_file() for path in order.work.glob("recordings/**/*"))


def test_some_recordings_are_kept_back(toy_corpus):
    names = toy_corpus.names()
    assert split_names(toy_corpus, names, held_out=False) == (sorted(names), [])
    learned, kept_back = split_names(toy_corpus, names, held_out=True)
    assert (learned, kept_back) == (sorted(toy_corpus.names("train")), sorted(toy_corpus.names("test")))
    without_list = [name for name in names if name not in kept_back]
    assert split_names(toy_corpus, without_list, held_out=True) == (without_list[:-1], without_list[-1:])
    assert split_names(toy_corpus, without_list[:9], held_out=True) == (without_list[:9], [])


def test_the_time_left_counts_down(tmp_path, monkeypatch):
    folder, now_s, (pipe, tells) = ProjectFolder(tmp_path), [0.0], Pipe(duplex=False)
    folder.change(lambda project: replace(project, recordings="."))
    process = SimpleNamespace(join=lambda: None, kill=tells.close)
    monkeypatch.setattr("lipmotion_studio.trainer.start_process", lambda *_: (process, pipe))
    trainer = Trainer(folder, lambda: now_s[0])
    trainer.begin("voice", "me", [], VoiceOptions())

    def told(at_s: float, **more: Any) -> tuple[Any, ...]:
        """Return what is told at a time, once something was reported."""
        now_s[0] = at_s
        if more:
            before = trainer.summarise()
            tells.send(more)
            wait_until(lambda: trainer.summarise() != before)
        document = trainer.summarise()
        return document["state"], document["share"], document.get("left_s")

    assert told(0.0, stage="tracking", share=0.0) == ("working", 0.0, None)
    assert told(20.0, stage="tracking", share=0.2) == ("working", 0.2, 80)
    assert told(50.0) == ("working", 0.2, 50)
    assert told(150.0) == ("working", 0.2, 0)
    assert told(160.0, stage="measuring", share=1.0) == ("working", 0.99, 2)
    assert told(170.0) == ("working", 0.99, 0)
    assert told(171.0, report={"minutes": 3.5}) == ("done", 1.0, None)
    tells.close()
    wait_until(lambda: trainer._thread is None)
    for opened in (trainer, Trainer(folder)):  # as it is, and as where the studio is opened again
        document = opened.describe()
        assert (document["kind"], document["file"], document["report"]["minutes"]) == (
            "voice",
            "voices/me.lipmotion",
            3.5,
        )


HEAD = '{"format": "lipmotion.training", "version": '


@pytest.mark.parametrize("damage", ["", "[]", "{}", f"{HEAD}2}}", f"{HEAD}1}}"])
def test_a_damaged_state_is_set_aside(tmp_path, damage, caplog):
    file = tmp_path / TRAINING / "state.json"
    file.parent.mkdir()
    file.write_text(damage, encoding="utf-8")
    trainer = Trainer(ProjectFolder(tmp_path))
    (kept,) = file.parent.iterdir()
    assert (trainer.describe(), kept.read_text(encoding="utf-8")) == ({}, damage)
    assert kept.name in caplog.text
    with pytest.raises(errors.InputError, match="begin with a voice"):
        trainer.retry()
