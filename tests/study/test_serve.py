"""``lipmotion study serve`` as a process: many scripted raters, kills in the middle, and hostile requests."""

import socket
import sqlite3
from contextlib import ExitStack, closing

import pytest

from children import wait_until
from lipmotion.errors import InputError
from lipmotion_studio.study import conduct, store
from lipmotion_studio.study.manifest import VIDEOS
from study.hostile import FOREIGN, hostile_requests
from study.served import Connection, ScriptedRater, raw_reply, send_junk, served
from study.small_study import small_study

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
    rows = conduct.collect_answers(folder)
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
        connection = Connection(server.port)
        token = connection.ask_until_answered("/api/raters", {"agrees": True})["token"]
        video = study.videos[0].file
        shown = {(folder / VIDEOS / each.file).read_bytes() for each in study.videos}
        manifest = (folder / "study.json").read_bytes()
        statuses = set()
        for hostile in hostile_requests(500, video, token):
            answered = raw_reply(server.port, hostile)
            if answered is None:
                continue
            reply, body = answered
            statuses.add(reply.status)
            assert FOREIGN.encode() not in body
            assert manifest[:200] not in body
            assert b"SQLite format" not in body
            assert b"root:" not in body
            assert reply.status < 500, hostile
            if reply.getheader("content-type") == "video/mp4" and reply.status == 200 and body:
                assert body in shown
        assert {404, 405, 401, 400} <= statuses
        send_junk(server.port)
        connection.close()
        later = Connection(server.port, token)
        wait_until(lambda: later.ask("/api/state")[0] == 200, 60)  # the limit on its requests has passed
        later.close()
        server.kill()
    assert "Traceback" not in errors.read_text(encoding="utf-8")
    assert conduct.collect_answers(folder) == []


def test_a_port_that_is_taken_is_said(tmp_path):
    small_study(tmp_path / "study")
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(InputError, match="another --port"):
        conduct.serve_study(tmp_path / "study", port=taken.getsockname()[1])
    with pytest.raises(InputError, match="another --port"):
        conduct.serve_study(tmp_path / "study", port=70_000)
