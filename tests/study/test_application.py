"""``lipmotion study serve`` as a process: many scripted raters, kills in the middle, and hostile requests."""

import json
import socket
import sqlite3
from argparse import Namespace
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from children import wait_until
from lipmotion.errors import InputError
from lipmotion_studio.study import store
from lipmotion_studio.study.answers import KINDS, MOS, PAIRED, read_answers
from lipmotion_studio.study.application import ANSWER_BURST, RateLimit, check_sheet, create_application
from lipmotion_studio.study.manifest import VIDEOS, Study, check_videos, order_trials
from lipmotion_studio.study.store import AnswerSheet, StudyStore, collect_answers, export_answers, forget_rater
from lipmotion_studio.verbs.study import run_serve
from lipmotion_studio.web.replies import HEADERS
from study.asgi import Application, ask
from study.hostile import FOREIGN, hostile_requests
from study.served import Connection, ScriptedRater, attacked, served
from study.small_study import scripted_answer, small_study

starlette = pytest.importorskip("starlette", reason="the extra 'study' is not installed")


PAGE = ("", "study.css", "study.js", "media.js", "icon.svg")
SENT = {"trial": 4, "values": ["second"], "plays": [1, 2], "seconds": 1.25}


class Open(NamedTuple):
    """A study that raters can come to."""

    study: Study
    folder: Path
    application: Application
    store: StudyStore

    def join(self) -> dict[str, Any]:
        return ask(self.application, "/api/raters", {"agrees": True}).content

    def send(self, token: str, answer: object) -> Any:
        return ask(self.application, "/api/answers", answer, token=token)


@pytest.fixture(params=[PAIRED])
def place(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Open]:
    folder = tmp_path / "study"
    study = small_study(folder, request.param)
    with closing(StudyStore(folder)) as store:
        yield Open(study, folder, create_application(study, check_videos(study, folder), store), store)


@pytest.mark.parametrize("place", KINDS, indirect=True)
def test_a_rater_from_the_first_page_to_the_last(place, tmp_path):
    now = place.join()
    token, rater = now["token"], now["rater"]
    assert "token" not in ask(place.application, "/api/state", token=token).content
    while now["trial"] < now["trials"]:
        if not now["trial"] % 10:  # as after a reload of the page
            assert ask(place.application, "/api/state", token=token).content["videos"] == now["videos"]
        reply = place.send(token, scripted_answer(place.study, now))
        assert (reply.status, reply.content["stored"]) == (200, now["trial"])
        ahead, now = now["ahead"], reply.content
        assert now.get("videos", []) == ahead
    place.store.close()
    export_answers(place.folder, tmp_path / "answers.csv")
    rows = read_answers(tmp_path / "answers.csv")
    assert {row.rater for row in rows} == {rater}
    assert sorted({row.trial for row in rows}) == list(range(len(place.study.trials)))
    assert {row.kind for row in rows} == {place.study.kind}
    assert sum(row.practice for row in rows if row.trial == 0) == sum(row.practice for row in rows) > 0
    expected = {row.expected for row in rows if row.expected}
    assert expected == {trial.expected for trial in place.study.trials if trial.expected}
    assert forget_rater(place.folder, rater) == len({(row.trial, row.question, row.condition) for row in rows})


def test_the_page_has_no_resource_from_elsewhere(place):
    for name in PAGE:
        text = ask(place.application, f"/{name}").body.decode()
        assert [word for word in text.split() if "://" in word and "www.w3.org/2000/svg" not in word] == []
        assert "innerHTML" not in text
        assert "<style" not in text


def test_nothing_that_raters_get_names_a_condition(place):
    pages = [ask(place.application, f"/{name}").body.decode() for name in PAGE]
    token = place.join()["token"]
    replies = [ask(place.application, path, token=token).body.decode() for path in ("/api/study", "/api/state")]
    for text in pages + replies:
        assert not [name for name in ("visemes", "phones", "recording by", "anchor") if name in text]


def test_no_trial_is_skipped(place):
    now = place.join()
    reply = place.send(now["token"], scripted_answer(place.study, now) | {"trial": 1})
    assert (reply.status, place.store.list_sheets()) == (409, [])


def test_a_link_that_is_not_known_and_a_rater_who_was_forgotten(place):
    now = place.join()
    for token in ("", "x", now["token"][:-1], now["token"] + "é"):
        assert ask(place.application, "/api/state", token=token).status == 401
    place.store.forget(1)
    assert place.send(now["token"], scripted_answer(place.study, now)).status == 401


@pytest.mark.parametrize(
    ("content", "headers", "status"),
    [
        (b"{", {}, 400), (b"\xff", {}, 400), (b"[" * 10_000, {}, 400), (b" " * 20_000, {}, 413),
        ({"trial": 0}, {}, 422), ({"trial": 0}, {"content-type": "text/plain"}, 415),
    ],
)  # fmt: skip
def test_bodies_that_are_refused(place, content, headers, status):
    token = place.join()["token"]
    reply = ask(place.application, "/api/answers", content, token=token, headers=headers)
    assert (reply.status, list(reply.content)) == (status, ["error"])
    assert place.store.list_sheets() == []


def test_nobody_joins_without_agreeing(place):
    assert ask(place.application, "/api/raters", {"agrees": False}).status == 422
    assert place.join()["rater"] == "r001"


def test_too_many_requests_of_one_rater_do_not_stop_another(place):
    first, second = place.join()["token"], place.join()["token"]
    found = [ask(place.application, "/api/state", token=first).status for _ in range(ANSWER_BURST + 30)]
    assert 429 in found
    assert ask(place.application, "/api/state", token=second).status == 200


def test_videos_are_served_whole_and_in_parts_and_nothing_else_is(place):
    video = place.study.videos[0]
    data = (place.folder / "videos" / video.file).read_bytes()
    whole = ask(place.application, f"/videos/{video.file}")
    assert (whole.status, whole.body, whole.headers["content-type"]) == (200, data, "video/mp4")
    part = ask(place.application, f"/videos/{video.file}", headers={"range": "bytes=2-5"})
    assert (part.status, part.body) == (206, data[2:6])
    for path in (
        "/videos/study.json", "/videos/../study.json", "/study.json", "/answers.sqlite", "/videos/" + "0" * 32,
    ):  # fmt: skip
        assert ask(place.application, path).status == 404


def test_every_reply_has_the_headers_that_keep_others_out(place):
    paths = ["/", "/study.js", "/api/study", "/api/state", "/nothing", f"/videos/{place.study.videos[0].file}"]
    for path in paths:
        headers = ask(place.application, path).headers
        assert {name: headers.get(name) for name in HEADERS} == HEADERS
    assert "default-src 'self'" in HEADERS["content-security-policy"]


ORIGINS = json.loads(Path(__file__).with_name("origins.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("headers", "status"), ORIGINS)
def test_only_the_page_itself_by_its_own_names_gets_an_answer(place, headers, status):
    application = create_application(place.study, {}, place.store, ["study.example.org"])
    assert ask(application, "/api/study", headers=headers).status == status
    assert ask(application, "/api/raters", {"agrees": True}, headers=headers).status == (201 if status == 200 else 403)


WRONG: list[dict[str, Any]] = [
    {"trial": -1}, {"trial": 1000}, {"trial": True}, {"trial": "4"}, {"trial": 4.0}, {"values": []}, {"values": [1]},
    {"values": ["third"]}, {"values": ["first", "first"]}, {"values": "first"}, {"values": None}, {"plays": [1]},
    {"plays": [1, 0]}, {"plays": [1, True]}, {"plays": [1, 10**9]}, {"plays": {}}, {"seconds": -1},
    {"seconds": 10**400}, {"seconds": "1.25"}, {"seconds": None}, {"more": 1}, {"seconds": 0.8},
]  # fmt: skip
"""In place of an answer's own; two videos last a second."""


@pytest.mark.parametrize("changed", [*(SENT | each for each in WRONG), None, [], "text", 7, {}, {"trial": 0}])
def test_anything_else_is_refused(tmp_path, changed):
    study = small_study(tmp_path / "study")
    trials = order_trials(study, 7)
    assert check_sheet(study, trials, 7, SENT) == AnswerSheet(7, 4, ("second",), 1.25, 3)
    with pytest.raises(InputError):
        check_sheet(study, trials, 7, changed)


def test_every_scale_has_a_value(tmp_path):
    opinions = small_study(tmp_path / "study", MOS)
    trials, sent = order_trials(opinions, 1), {"trial": 0, "plays": [1], "seconds": 0.5}
    sheet = check_sheet(opinions, trials, 1, sent | {"values": ["01", "2", "3", "4", "5"]})
    assert sheet.values == ("1", "2", "3", "4", "5")
    for values in (["1"] * 4, ["0", "2", "3", "4", "5"], ["6", "2", "3", "4", "5"], ["٣", "2", "3", "4", "5"]):
        with pytest.raises(InputError):
            check_sheet(opinions, trials, 1, sent | {"values": values})


def test_a_burst_and_then_a_rate():
    now_s = [100.0]
    limit = RateLimit(2.0, 5, lambda: now_s[0])
    assert [limit.allows("a") for _ in range(7)] == [True] * 5 + [False] * 2
    assert limit.allows("b")
    now_s[0] += 0.5
    assert [limit.allows("a") for _ in range(2)] == [True, False]
    now_s[0] += 60
    assert [limit.allows("a") for _ in range(7)] == [True] * 5 + [False] * 2
    limit = RateLimit(1.0, 2, lambda: now_s[0])  # nothing is kept of those who have gone
    for asker in range(20_000):
        now_s[0] += 0.01
        assert limit.allows(asker)
    assert len(limit._full_at_s) < 3000


pytest.importorskip("uvicorn", reason="the extra 'study' is not installed")
RATERS, KILLS = 20, 3


@pytest.mark.long
def test_twenty_scripted_raters_and_kills_in_the_middle(tmp_path):
    """Whatever was acknowledged is in the database, once; every rater comes to the end."""
    folder, errors = tmp_path / "study", tmp_path / "errors.txt"
    study = small_study(folder)
    with ExitStack() as stack:
        servers = [stack.enter_context(served(folder, errors))]
        port = servers[0].port
        raters = [ScriptedRater(study, port, number, 0.02) for number in range(RATERS)]
        for rater in raters:
            rater.start()
        for kill in range(KILLS):
            enough = (kill + 1) * RATERS * len(study.trials) // (KILLS + 2)
            wait_until(lambda enough=enough: sum(len(rater.acknowledged) for rater in raters) >= enough)  # type: ignore[misc]
            servers[-1].kill()
            known = [dict(rater.acknowledged) for rater in raters]
            with closing(sqlite3.connect(folder / store.ANSWERS)) as database:
                stored = database.execute("SELECT rater, trial, value FROM answers").fetchall()
            values = {(rater, trial): value for rater, trial, value in stored}
            assert len(values) == len(stored) >= sum(map(len, known))
            servers.append(stack.enter_context(served(folder, errors, port)))
        for rater in raters:
            rater.join(120)
        assert [rater.failure for rater in raters] == [None] * RATERS
        assert not any(rater.is_alive() for rater in raters)
        servers[-1].kill()
    rows = collect_answers(folder)
    assert len(rows) == RATERS * len(study.trials)
    assert len({(row.rater, row.trial, row.question) for row in rows}) == len(rows)
    by_rater = sorted(
        [row.value for row in sorted(rows, key=lambda row: row.trial) if row.rater == name]
        for name in {row.rater for row in rows}
    )
    sent = sorted([rater.acknowledged[trial] for trial in range(len(study.trials))] for rater in raters)
    assert by_rater == sent
    assert "Traceback" not in errors.read_text(encoding="utf-8")


@pytest.mark.long
def test_hostile_requests_get_no_file_and_leave_no_traceback(tmp_path):
    folder, errors = tmp_path / "study", tmp_path / "errors.txt"
    study = small_study(folder)
    for foreign in (folder / "foreign.mp4", folder / VIDEOS / "foreign.mp4", tmp_path / "foreign.mp4"):
        foreign.write_text(FOREIGN, encoding="utf-8")
    with served(folder, errors) as server:
        connection = Connection(server.port, {})
        token = connection.ask_until_answered("/api/raters", {"agrees": True})["token"]
        video = study.videos[0].file
        secrets = FOREIGN.encode(), (folder / "study.json").read_bytes()[:200], b"SQLite format"
        shown, statuses = {(folder / VIDEOS / each.file).read_bytes() for each in study.videos}, set()
        for reply, body in attacked(server.port, hostile_requests(500, video, token), secrets):
            statuses.add(reply.status)
            if reply.getheader("content-type") == "video/mp4" and reply.status == 200 and body:
                assert body in shown
        assert {404, 405, 401, 400} <= statuses
        assert max(statuses) < 500
        connection.close()
        later = Connection(server.port, {"authorization": f"Bearer {token}"})
        wait_until(lambda: later.ask("/api/state")[0] == 200, 60)  # the limit on its requests has passed
        later.close()
        server.kill()
    assert "Traceback" not in errors.read_text(encoding="utf-8")
    assert collect_answers(folder) == []


def test_a_port_that_is_taken_is_said(tmp_path):
    small_study(tmp_path / "study")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        for port in (taken.getsockname()[1], 70_000):
            with pytest.raises(InputError, match="another --port"):
                run_serve(Namespace(study=tmp_path / "study", host="127.0.0.1", port=port, name=[]))
