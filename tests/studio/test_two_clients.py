"""Lines are what their sounds are, changes name what they saw, damaged edits are an error: two clients of a studio."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from lipmotion import Model
from lipmotion.pipeline.edit_files import read_edits, write_edits
from study.small_study import sha256_of
from testing.toy import ToySentence

pytest.importorskip("starlette", reason="the extra 'studio' is not installed")

from studio.open_studio import OpenStudio, open_studio
from studio.two_clients import walk


@pytest.fixture
def studio(toy_speech: Path, toy_sentence: ToySentence, toy_model: Model, tmp_path: Path) -> Iterator[OpenStudio]:
    with open_studio(toy_speech, " ".join(toy_sentence.words), toy_model, tmp_path) as opened:
        opened.ready()
        yield opened


def test_a_line_that_was_removed_has_its_edits_when_its_sound_is_added_again(studio):
    sound = studio.folder.locate_sound(studio.folder.find_recording(1))
    assert studio.edit("phone 3 is p").status == 200
    assert studio.change("remove").status == 200
    other = sound.with_name("inner") / "line.wav"
    other.parent.mkdir()
    other.write_bytes(sound.read_bytes()[:-2] + b"\0\1")
    assert [studio.folder.find_recording(number).name for number in studio.folder.add(other)] == ["line-2"]
    assert [studio.folder.find_recording(number).name for number in studio.folder.add(sound)] == ["line"]
    assert studio.ready(3)["steps"] == ["phone 3 is p"]


def test_every_change_names_the_revision_that_it_saw(studio):
    members = {"steps": ["phone 2 is p"], "text": "mama", "mark": "redo"}
    seen = studio.ready()["revision"]
    assert studio.edit("phone 3 is p").status == 200
    for change in ("edits", "undo", "transcript", "mark", "versions", "remove", "restore"):
        assert studio.ask(f"/api/lines/1/{change}", members).status == 422
        late = studio.ask(f"/api/lines/1/{change}", members | {"revision": seen})
        assert (late.status, "window" in late.content["error"]) == (409, True)
    state = studio.ready()
    assert (state["steps"], state["mark"], state["versions"]) == (["phone 3 is p"], "none", [])
    tear = {"word": "tear", "phones": ["t", "eh", "r"]}
    for path, content in (("/api/voice", {"voice": ""}), ("/api/lexicon", tear)):
        seen = studio.ask("/api/training" if path == "/api/voice" else f"{path}?word=tear").content["revision"]
        assert studio.ask(path, content).status == 422
        late = studio.ask(path, content | {"revision": seen + 1})
        assert (late.status, "window" in late.content["error"]) == (409, True)
        assert studio.ask(path, content | {"revision": seen}).status == 200
    assert studio.folder.load_lexicon().user == {"tear": (("t", "eh", "r"),)}
    late = studio.ask("/api/lexicon", {"word": "tear", "phones": ["t", "ih", "r"], "revision": seen})
    assert (late.status, len(studio.folder.load_lexicon().user["tear"])) == (409, 1)


@pytest.mark.parametrize("damaged", [lambda content: content[:-40], lambda _: b"", lambda _: b"\xff\x00{" * 40])
def test_damaged_edits_are_an_error_with_a_way_back(studio, damaged):
    assert studio.edit("phone 3 is p").status == 200
    seen, file = studio.row(), studio.folder.locate_edits(studio.folder.find_recording(1))
    damage = damaged(file.read_bytes())
    file.write_bytes(damage)
    row = studio.row()
    assert (row["status"], str(file) in row["error"]) == ("failed", True)
    assert "copies/line.edits.json" in row["error"]
    late = {"revision": seen["revision"], "steps": ["phone 4 is p"]}
    assert studio.ask("/api/lines/1/edits", late).status in (422, 503)
    for what in ("transcript", "mark"):
        assert studio.change(what, text="mama", mark="redo").status == 422
    (failed,) = studio.ask("/api/lines/1/export", {"files": [".csv"]}).content["failed"]
    assert (failed["error"], file.read_bytes()) == (row["error"], damage)
    state = studio.ready()
    assert (state["status"], state["restorable"]) == ("failed", True)
    assert studio.change("restore").status == 200
    assert studio.ready()["steps"] == ["phone 3 is p"]
    assert [each.read_bytes() for each in file.parent.glob("*.damaged-*")] == [damage]
    assert studio.change("restore").status == 422


def test_edits_that_others_make_of_an_open_line_are_seen(studio):
    state, line = studio.ready(), studio.folder.find_recording(1)
    file = read_edits(studio.folder.locate_edits(line))
    write_edits(file.then("phone 3 is p"), studio.folder.locate_edits(line))
    content = {"revision": state["revision"], "steps": ["phone 4 is p"]}
    assert studio.ask("/api/lines/1/edits", content).status in (409, 503)
    assert studio.ready()["steps"] == ["phone 3 is p"]


@pytest.mark.parametrize(
    "damaged", [Path.unlink, lambda file: file.write_text(file.read_text("utf-8").replace('"start_s"', '"stort_s"'))]
)
def test_a_line_whose_file_is_lost_or_has_no_phones_is_restored(studio, damaged):
    assert studio.edit("phone 3 is p").status == 200
    damaged(studio.folder.locate_edits(studio.folder.find_recording(1)))
    studio.studio.workspace.forget(1)
    assert (studio.ready()["status"], studio.ready()["restorable"]) == ("failed", True)
    assert studio.change("restore").status == 200
    assert studio.ready()["steps"] == ["phone 3 is p"]


@pytest.mark.parametrize("is_moved", [True, False])
def test_a_line_whose_sound_is_another_one_waits_for_its_own(studio, tmp_path, is_moved):
    sound = studio.folder.locate_sound(studio.folder.find_recording(1))
    own = sound.rename(tmp_path / "own")
    if not is_moved:
        sound.write_bytes(own.read_bytes()[:-2] + b"\0\1")
    assert studio.ask("/api/lines/1/sound.wav").status == 422
    (failed,) = studio.ask("/api/lines/1/export", {"files": [".csv"]}).content["failed"]
    assert sound.name in failed["error"]
    studio.studio.workspace.forget(1)
    assert (studio.ready()["status"], sound.name in studio.ready()["error"]) == ("failed", True)
    assert studio.edit("phone 3 is p").status == 422
    own.replace(sound)
    studio.ask("/api/understand", {"lines": [1]})
    assert studio.ready()["status"] == "ready"


def test_of_changes_at_the_same_time_one_is_made(studio):
    members = {"revision": studio.ready()["revision"], "steps": ["phone 3 is p"], "text": "bob", "mark": "redo"}
    requests = [(f"/api/lines/1/{way}", members) for way in ("edits", "transcript", "mark", "remove")] * 2
    statuses = [reply.status for reply in studio.ask_together(*requests)]
    assert statuses.count(200) == 1
    assert set(statuses) <= {200, 404, 409, 503}


def test_edits_whose_digest_was_taken_out_get_that_of_their_sound(toy_speech, toy_sentence, toy_model, tmp_path):
    words = " ".join(toy_sentence.words)
    with open_studio(toy_speech, words, toy_model, tmp_path) as studio:
        studio.ready()
        assert studio.edit("phone 3 is p").status == 200
        file = studio.folder.locate_edits(studio.folder.find_recording(1))
    document = json.loads(file.read_text(encoding="utf-8"))
    del document["recording_sha256"]
    file.write_text(json.dumps(document), encoding="utf-8")
    with open_studio(toy_speech, words, toy_model, tmp_path) as studio:
        assert studio.ready()["steps"] == ["phone 3 is p"]
    assert read_edits(file).sha256 == sha256_of(toy_speech)
    assert (studio.folder.path / "copies" / file.name).read_bytes() == file.read_bytes()


def test_nothing_that_was_acknowledged_is_lost(toy_model, toy_sentence, tmp_path):
    found = walk(toy_model, toy_sentence, tmp_path, 2, 10)
    assert found.steps > 10


@pytest.mark.long
def test_hundreds_of_steps_lose_nothing(toy_model, toy_sentence, tmp_path):
    found = walk(toy_model, toy_sentence, tmp_path, 6, 60)
    assert found.steps > 300
    assert min(found.acknowledged, found.late, found.refused) > 10
