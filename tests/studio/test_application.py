import io
import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from typing import Any

import av
import numpy as np
import pytest

from lipmotion import load_model, save_model, units
from lipmotion.pipeline.edits import FORMS

pytest.importorskip("starlette", reason="the extra 'studio' is not installed")

from lipmotion.storage.locks import LOCK
from lipmotion_studio import recording as recording_module
from lipmotion_studio.application import TOKEN_HEADER, Access, create_application
from lipmotion_studio.folder import ProjectFolder, open_folder
from lipmotion_studio.project import parse_project
from lipmotion_studio.studio import Studio, load_known_model
from studio.open_studio import HOST, TOKEN, OpenStudio, open_studio, toy
from testing.toy import write_film

OTHER_DIGEST = "1" * 64


@pytest.fixture(scope="module")
def place(toy_speech, toy_sentence, toy_model, tmp_path_factory) -> Iterator[OpenStudio]:
    folder = tmp_path_factory.mktemp("studio")
    with open_studio(toy_speech, " ".join(toy_sentence.words), toy_model, folder) as opened:
        yield opened


@pytest.fixture
def studio(place: OpenStudio) -> OpenStudio:
    """The same studio, its line without edits."""
    state = place.ready()
    if state["undo"]:
        place.ask("/api/lines/1/undo", {"revision": state["revision"], "count": state["undo"]})
    return place


def stored(studio: OpenStudio) -> dict[str, Any]:
    """Return the file of the edits of the line."""
    return dict(json.loads(studio.folder.locate_edits(studio.folder.find_recording(1)).read_text(encoding="utf-8")))


def test_an_edit_is_made_stored_and_taken_back(studio):
    before = studio.ready()
    assert before["transcript"] == (studio.folder.path.parent / "line.txt").read_text(encoding="utf-8")
    reply = studio.edit("phone 3 is p", "pin opening 0.1 at 1.0")
    state = reply.content
    assert (reply.status, state["undo"], state["phones"][2]["label"]) == (200, 2, "p")
    assert "edited_opening" not in str(state["channels"])  # it says where an edit decided; nobody pins it
    assert 0 < state["changed"]["start_s"] < before["phones"][2]["end_s"]
    assert stored(studio)["steps"] == ["phone 3 is p", "pin opening 0.1 at 1.0"]
    undone = studio.ask("/api/lines/1/undo", {"revision": state["revision"], "count": 2}).content
    assert (undone["phones"], undone["redo"]) == (before["phones"], 2)
    assert stored(studio)["undone"] == state["steps"]
    redone = studio.ask("/api/lines/1/redo", {"revision": undone["revision"]}).content
    assert (redone["steps"], redone["redo"]) == (["phone 3 is p"], 1)
    dragged = studio.edit("phone 3 is m", instead=1).content  # each edit replaces the one before
    assert (dragged["steps"], dragged["redo"]) == (["phone 3 is m"], 0)


def test_phones_that_edits_have_touched_are_told(studio):
    def edited(state: dict[str, Any]) -> list[int]:
        return [number for number, phone in enumerate(state["phones"], 1) if phone["edited"]]

    before = studio.ready()
    own, end_s = before["phones"][2]["label"], before["phones"][4]["end_s"]
    assert edited(before) == []
    assert edited(studio.edit("phone 3 is p", "pin opening 0.1 at 1.0").content) == [3]
    assert edited(studio.edit(f"phone 5 ends {end_s - 0.01:.3f}").content) == [3, 5, 6]
    assert edited(studio.edit(f"phone 3 is {own}").content) == [5, 6]
    assert edited(studio.edit("split phone 1 at 0.02").content) == [1, 2, 6, 7]


@pytest.mark.parametrize(
    ("content", "status"),
    [
        ({"revision": None, "steps": ["phone 3 is p"]}, 422), ({"steps": ["phone 99 is p"]}, 422),
        ({"steps": ["jump"]}, 422), ({"steps": "phone 3 is p"}, 422), ({"steps": [], "instead": 1}, 422), ([], 422),
        (b"{", 400), (b" " * (1 << 21), 413),
    ],
)  # fmt: skip
def test_edits_that_are_refused_change_nothing(studio, content, status):
    before = studio.ready()
    if isinstance(content, dict):
        content = {"revision": before["revision"]} | content
    reply = studio.ask("/api/lines/1/edits", content)
    assert (reply.status, list(reply.content)) == (status, ["error"])
    assert studio.ready() == before


def test_words_are_corrected_where_they_are_said(studio):
    word = studio.ready()["words"][0]
    content = {
        "text": " mama ", "start_s": word["start_s"], "end_s": word["end_s"], "revision": studio.ready()["revision"],
    }  # fmt: skip
    state = studio.ask("/api/lines/1/transcript", content).content
    assert "mama" in [found["label"] for found in state["words"]]
    assert state["words"][1:] == studio.ready()["words"][1:]
    assert state["steps"][0].startswith("say mama from")


def test_numbers_are_those_of_the_motion(studio):
    state = studio.ready()
    reply = studio.ask("/api/lines/1/motion?start_s=0.5&end_s=1.0")
    names = json.loads(reply.headers["x-lipmotion-names"])
    found = np.frombuffer(reply.body, "<f4").reshape(-1, len(names))
    assert names == [channel["name"] for channel in state["channels"]]
    values = studio.studio.workspace.find_work(1).recording.generation.motion.values
    assert found == pytest.approx(values[50:101], abs=1e-6)
    assert reply.headers["x-lipmotion-first"] == "50"
    some = studio.ask("/api/lines/1/motion?names=width,opening&start_s=0.5&end_s=1.0")
    assert json.loads(some.headers["x-lipmotion-names"]) == ["width", "opening"]
    chosen = found[:, [names.index("width"), names.index("opening")]]
    assert np.frombuffer(some.body, "<f4").reshape(-1, 2) == pytest.approx(chosen)
    refused = studio.ask("/api/lines/1/motion?names=opening,jump")
    assert (refused.status, "'jump'" in refused.content["error"]) == (422, True)
    sure = np.frombuffer(studio.ask("/api/lines/1/motion?of=confidence").body, "<f4")
    assert len(sure) == state["frames"]
    assert 0 <= sure.min() <= sure.max() <= 1
    assert studio.ask("/api/lines/1/motion?of=nothing").status == 422
    assert studio.ask("/api/lines/1/motion?start_s=99").status == 422


def test_of_a_long_line_the_whole_motion_is_made_when_it_is_asked_for(studio, monkeypatch):
    assert studio.ready()["settled"]
    monkeypatch.setattr(recording_module, "LONG_S", 0.0)
    state = studio.edit("phone 3 is p").content
    assert not state["settled"]
    work = studio.studio.workspace.find_work(1)
    assert studio.ask("/api/lines/1/settle", {"revision": state["revision"] + 1}).status == 409
    state = studio.ask("/api/lines/1/settle", {"revision": state["revision"]}).content
    assert state["settled"]
    whole = work.recording.session.generate(work.recording.file.edits).motion.values
    found = np.frombuffer(studio.ask("/api/lines/1/motion").body, "<f4").reshape(whole.shape)
    assert found == pytest.approx(whole, abs=1e-6)


def test_why_and_doubts(studio):
    doubts = studio.ask("/api/lines/1/doubts").content
    assert [row["confidence"] for row in doubts] == sorted(row["confidence"] for row in doubts)
    why = studio.ask(f"/api/lines/1/why?time={doubts[0]['time_s']}").content
    assert why["phone"] == studio.ready()["phones"][doubts[0]["phone"] - 1]["label"]
    assert why["confidence"] == pytest.approx(doubts[0]["confidence"], abs=0.5)
    assert "phone" in why["text"]
    assert studio.ask("/api/lines/1/why?time=1000").status == 422


def test_a_line_is_marked_exported_and_then_changed(studio):
    assert studio.change("mark", mark="approved").content["mark"] == "approved"
    assert studio.change("mark", mark="perhaps").status == 422
    assert studio.row()["marked"] == studio.row()["edits_digest"]
    studio.edit("phone 3 is p")
    assert studio.row()["marked"] != studio.row()["edits_digest"] == studio.ready()["edits_digest"]
    done = studio.ask("/api/export", {"files": [".csv"], "only": "approved"}).content
    assert (done["exported"][0]["files"], done["failed"]) == (["exports/line.csv"], [])
    assert json.loads((studio.folder.path / "exports" / "line.edits.json").read_text())["steps"] == ["phone 3 is p"]
    assert studio.row()["exported"] == "yes"
    studio.edit("phone 3 is m")
    assert studio.row()["exported"] == "changed"
    wrongs: tuple[dict[str, object], ...] = (
        {"files": ["/../x.csv"]}, {"files": []}, {"preset": "x"}, {"preset": "arkit", "only": "some"},
    )  # fmt: skip
    for wrong in wrongs:
        assert studio.ask("/api/export", wrong).status == 422


@pytest.mark.skipif(sys.platform == "win32", reason="links as POSIX has them")
def test_exports_do_not_follow_links(studio, tmp_path):
    (tmp_path / "precious.csv").write_text("precious")
    exports = studio.folder.path / "exports"
    exports.mkdir(exist_ok=True)
    for name in ("line.csv", "line.edits.json"):
        (exports / name).unlink(missing_ok=True)
        (exports / name).symlink_to(tmp_path / "precious.csv")
    assert studio.ask("/api/lines/1/export", {"files": [".csv"]}).content["failed"] == []
    exports.rename(tmp_path / "moved")
    exports.symlink_to(tmp_path / "moved")
    (tmp_path / "moved" / "line.csv").unlink()
    (failed,) = studio.ask("/api/lines/1/export", {"files": [".csv"]}).content["failed"]
    assert "is a link" in failed["error"]
    exports.unlink()
    assert (tmp_path / "precious.csv").read_text() == "precious"
    assert not (tmp_path / "moved" / "line.csv").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="limits of files as POSIX has them")
def test_a_recording_that_the_disk_cannot_take_is_refused(studio):
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        reply = studio.ask("/api/lines?name=large.wav", b"RIFF" * 1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert reply.status == 503
    assert "try again" in reply.content["error"]
    assert not [path for path in studio.folder.path.iterdir() if path.name.startswith(".part-") and path.name != LOCK]


def test_pronunciations_are_offered_and_kept(studio):
    tear = studio.ask("/api/lexicon?word=Tear").content
    assert ["t", "eh", "r"] in tear["pronunciations"]
    seen = studio.ask("/api/lexicon?word=zenodo").content["revision"]
    kept = studio.ask("/api/lexicon", {"word": "zenodo", "phones": ["z", "eh", "n", "ow"], "revision": seen}).content
    assert (kept["own"], kept["pronunciations"]) == (True, [["z", "eh", "n", "ow"]])
    assert studio.folder.load_lexicon().pronunciations("zenodo") == (("z", "eh", "n", "ow"),)
    state = studio.edit("word 1 is zenodo").content
    assert state["steps"] == ["word 1 is zenodo said z eh n ow"]
    state = studio.ask("/api/lines/1/undo", {"revision": state["revision"]}).content
    part = {"start_s": 0.0, "end_s": state["words"][0]["end_s"], "revision": state["revision"]}
    said = studio.ask("/api/lines/1/transcript", {"text": "zenodo mamaqu", **part}).content
    assert [step.partition(" with ")[2] for step in said["steps"]] == ["zenodo z eh n ow"]
    assert said["guessed"] == [{"word": "mamaqu", "phones": list(units.Lexicon().pronunciations("mamaqu")[0])}]
    at_work = [phone["label"] for phone in said["phones"] if phone["word"] == "zenodo"]
    assert at_work == ["z", "eh", "n", "ow"]
    for wrong in ({"word": "a b", "phones": ["b"]}, {"word": "a", "phones": ["B!"]}, {"word": "a", "phones": []}):
        assert studio.ask("/api/lexicon", wrong | {"revision": 0}).status == 422


def test_lists_and_forms_follow_from_the_registries(studio):
    found = studio.ask("/api/project?from=0&count=5").content
    assert [row["name"] for row in found["lines"]] == ["line"]
    assert found["lines"][0]["duration_s"] == pytest.approx(studio.ready()["duration_s"])
    assert found["forms"]["edit_forms"] == list(FORMS)
    assert {face["name"] for face in found["forms"]["faces"] if face["mesh"]} == {"head"}
    assert studio.ask("/api/progress").content["waiting"] == 0


def test_only_the_page_itself_with_the_token_gets_an_answer(studio):
    assert studio.ask("/api/project", **{TOKEN_HEADER: "other"}).status == 401
    assert studio.ask("/api/project", host="example.org").status == 403
    assert studio.ask("/api/project", origin="http://example.org").status == 403
    assert studio.ask("/api/project", origin=f"http://{HOST}").status == 200
    assert studio.ask("/api/project", sec_fetch_site="cross-site").status == 403
    path = "/api/lines/1/sound.wav"
    keyed = f"{path}?key={Access(TOKEN, frozenset({HOST})).make_key(path)}"
    assert studio.ask(keyed, **{TOKEN_HEADER: ""}).status == 200
    assert studio.ask(keyed.replace("sound.wav", "doubts"), **{TOKEN_HEADER: ""}).status == 401
    for path in (
        "/api/lines/2", "/api/lines/0", "/api/lines/1e3", f"/api/lines/{'9' * 5000}", "/project.json", "/../x",
    ):  # fmt: skip
        assert studio.ask(path).status == 404
    assert studio.ask("/api/faces/portrait.glb").status == 404


def test_what_is_dropped_is_read_by_the_same_readers(studio):
    for name in ("../../speech.txt", "speech", ""):
        assert studio.ask(f"/api/lines?name={name}", b"RIFF").status == 422
    reply = studio.ask("/api/lines?name=../no%20sound.wav", b"no sound", x_lipmotion_transcript="mama%20papa")
    assert (reply.status, reply.content["name"]) == (201, "no sound")
    state = studio.ready(reply.content["id"])
    assert (state["status"], "recording" in state["error"], state["transcript"]) == ("failed", True, "mama papa")
    assert (studio.folder.path / "sounds" / "no sound.wav").read_bytes() == b"no sound"
    assert studio.ask(f"/api/lines/{reply.content['id']}/doubts").status == 422
    assert studio.change("remove", reply.content["id"]).status == 200
    assert studio.ask("/api/project").content["count"] == 1


def test_a_model_is_called_as_its_file(toy_model, tmp_path):
    save_model(replace(toy_model, about={**toy_model.about, "name": "trajectory"}), tmp_path / "Sam.lipmotion")
    assert load_known_model(tmp_path / "Sam.lipmotion").name == "Sam"


def test_a_project_outlives_its_model(tmp_path, caplog):
    with open_folder(None, tmp_path / "project") as folder:
        folder.change(lambda project: replace(project, model="../gone.lipmotion"))
        with closing(Studio(folder)) as studio:
            assert studio.workspace.model.about == load_model().about
    assert "the model of the project is not there" in caplog.text


def test_what_the_list_says_of_a_line_outlives_a_kill(tmp_path, toy_speech, toy_sentence, toy_model):
    for _ in range(2):
        with open_studio(toy_speech, " ".join(toy_sentence.words), toy_model, tmp_path) as studio:
            duration_s = studio.ready()["duration_s"]
            (stored,) = ProjectFolder(studio.folder.path).project.lines.values()  # as where it is killed now
            assert stored.duration_s == pytest.approx(duration_s)
            assert stored.doubt is not None
            studio.folder.change_recording(1, lambda line: replace(line, duration_s=None, doubt=None))


@pytest.mark.long
def test_lines_that_are_not_used_are_closed_and_open_again_as_they_were(studio, toy_speech, monkeypatch):
    monkeypatch.setattr("lipmotion_studio.workspace.MAX_OPEN", 1)
    edited = studio.edit("phone 3 is p").content
    reply = studio.ask("/api/lines?name=other.wav", toy_speech.read_bytes())
    other = reply.content["id"]
    assert studio.ready(other)["status"] == "ready"
    assert studio.studio.workspace.find_work(1) is None
    again = studio.ready()
    assert (again["steps"], again["revision"]) == (["phone 3 is p"], edited["revision"])
    assert studio.studio.workspace.find_work(other) is None
    assert studio.ask("/api/understand", {"lines": "all"}).content["waiting"] == 0
    assert studio.ask("/api/understand", {"lines": [99]}).status == 404
    said = studio.change("transcript", other, text="mama").content
    assert said["status"] in ("waiting", "working")
    assert {word["label"] for word in studio.ready(other)["words"]} == {"mama"}
    assert studio.change("remove", other).status == 200


@pytest.mark.long
def test_weights_of_a_part_are_those_of_the_whole(studio):
    studio.edit("phone 3 is p", "pin jawOpen 0.7 at 1.0")
    reply = studio.ask("/api/lines/1/weights?face=head")
    names = json.loads(reply.headers["x-lipmotion-names"])
    weights = np.frombuffer(reply.body, "<f4").reshape(-1, len(names))
    part = np.frombuffer(studio.ask("/api/lines/1/weights?face=head&start_s=0.8&end_s=1.2").body, "<f4")
    assert part.reshape(-1, len(names)) == pytest.approx(weights[80:121], abs=0.01)
    assert studio.ask(f"/api/faces/{reply.headers['x-lipmotion-mesh']}.glb").body[:4] == b"glTF"
    video = studio.ask("/api/lines/1/video", {"start_s": 0.5, "end_s": 0.7})
    assert video.headers["content-type"] == "video/mp4"
    assert studio.ask("/api/lines/1/picture?time=0.5").body[:4] == b"\x89PNG"


@pytest.fixture
def compared(tmp_path, toy_speech, toy_sentence, toy_model, coupled_model, filmed_face_file) -> Iterator[OpenStudio]:
    """A studio whose line has a real video, with a filmed face and another model of the same name."""
    sound = tmp_path / "line.wav"
    shutil.copy(toy_speech, sound)
    sound.with_suffix(".txt").write_text(" ".join(toy_sentence.words), encoding="utf-8")
    pictures = [np.full((32, 48, 3), 60 + 4 * number, np.uint8) for number in range(20)]
    write_film(sound.with_suffix(".mp4"), pictures, sound)
    with open_folder(sound) as opened:
        opened.change(lambda now: replace(now, characters={"toy": str(filmed_face_file)}))
        with closing(Studio(opened, toy(toy_model), replace(toy(coupled_model), digest=OTHER_DIGEST))) as running:
            yield OpenStudio(opened, running, create_application(running, Access(TOKEN, frozenset({HOST}))))


@pytest.mark.long
def test_a_filmed_face_the_real_video_and_another_model(compared, tmp_path):
    studio = compared
    studio.ready()
    plain, other = (studio.ask(f"/api/lines/1/motion{query}").body for query in ("", "?by=other"))
    assert (len(plain) > 0, plain == other) == (True, False)
    assert studio.edit("pin opening 0.3 at 0.5").status == 200
    edited = studio.ask("/api/lines/1/motion?by=other")
    names = json.loads(edited.headers["x-lipmotion-names"])
    shown = np.frombuffer(edited.body, "<f4").reshape(-1, len(names))
    assert shown[50, names.index("opening")] == pytest.approx(0.3, abs=1e-5)
    some = studio.ask("/api/lines/1/motion?by=other&names=opening,jump")
    assert json.loads(some.headers["x-lipmotion-names"]) == ["opening"]
    assert np.frombuffer(some.body, "<f4") == pytest.approx(shown[:, names.index("opening")])
    none = studio.ask("/api/lines/1/motion?by=other&names=jump")
    assert (none.status, none.headers["x-lipmotion-names"], none.body) == (200, "[]", b"")
    assert studio.ask("/api/lines/1/motion?by=../x").status == 422

    assert studio.ask("/api/project").content["forms"]["against"] == f"toy ({OTHER_DIGEST[:8]})"

    refused = studio.ask("/api/lines/1/picture?time=0.5&face=toy")
    assert (refused.status, "video" in refused.content["error"]) == (422, True)
    assert studio.ask("/api/faces/toy.glb").status == 404
    reply = studio.ask("/api/lines/1/video", {"start_s": 0.2, "end_s": 0.6, "face": "toy"})
    assert reply.headers["content-type"] == "video/mp4"
    with av.open(io.BytesIO(reply.body)) as film:
        assert len(film.streams.audio) == 1
        assert sum(1 for _ in film.decode(video=0)) == 11  # from 0.2 to 0.6 s, both shown

    # the video of a preset is that of the face, with its mark; other files do not depend on it
    for wanted in ({"preset": "video", "face": "toy"}, {"files": [".csv"]}):
        assert studio.ask("/api/lines/1/export", wanted).content["failed"] == []
    exports = studio.folder.path / "exports"
    with av.open(str(exports / "line.mp4")) as film:
        assert film.metadata["comment"].startswith("synthetic:")
    table = (exports / "line.csv").read_bytes()
    assert studio.ask("/api/lines/1/export", {"files": [".csv"], "face": "toy"}).content["failed"] == []
    assert (exports / "line.csv").read_bytes() == table
    (failed,) = studio.ask("/api/lines/1/export", {"preset": "video", "face": "../x"}).content["failed"]
    assert "no face" in failed["error"]

    address = studio.ready()["media"]["video"]
    part = studio.ask(address, range="bytes=4-7", **{TOKEN_HEADER: ""})
    assert (part.status, part.body, part.headers["content-type"]) == (206, b"ftyp", "video/mp4")
    assert studio.ask(address.partition("?")[0], **{TOKEN_HEADER: ""}).status == 401
    (tmp_path / "line.mp4").unlink()
    assert studio.ask(address).status == 404


def test_versions_are_kept_shown_and_gone_back_to(studio):
    """What was there when one goes back is kept, too."""
    assert studio.edit("pin opening 0.3 at 0.5").status == 200
    first = studio.ready()
    assert studio.change("versions").content["versions"] == [
        {"name": "version-1", "number": 1, "edits": first["undo"], "digest": first["edits_digest"]}
    ]
    assert len(studio.change("versions").content["versions"]) == 1  # there is one of these edits
    then = studio.ask("/api/lines/1/motion").body
    assert studio.edit("phone 3 is p").status == 200
    now = studio.ask("/api/lines/1/motion").body
    assert now != then
    assert studio.ask("/api/lines/1/motion?by=version-1").body == then
    assert studio.ask("/api/lines/1/weights?by=version-1").body != studio.ask("/api/lines/1/weights").body
    back = studio.ask("/api/lines/1/versions/back", {"revision": studio.ready()["revision"], "version": "version-1"})
    assert back.content["steps"] == first["steps"]
    assert back.content["changed"]
    assert [each["edits"] for each in back.content["versions"]] == [first["undo"], first["undo"] + 1]
    assert studio.ask("/api/lines/1/motion").body == then
    assert studio.ask("/api/lines/1/motion?by=version-2").body == now
    read = parse_project(json.loads((studio.folder.path / "project.json").read_text(encoding="utf-8")))
    assert [len(each.steps) for each in read.lines[1].versions] == [first["undo"], first["undo"] + 1]
    assert studio.change("versions/forget", version="version-2").content["versions"][-1]["number"] == 1
    for wrong in ("version-2", "other", ""):
        assert studio.change("versions/forget", version=wrong).status == 422
    old = {"revision": studio.ready()["revision"] - 1, "version": "version-1"}
    assert studio.ask("/api/lines/1/versions/back", old).status == 409
