"""A voice of one's own in a real browser: trained on toy recordings, its report read, the voice used and taken back."""

import os
from dataclasses import replace

import pytest

from children import wait_until
from study.browser import NEEDED, check_screens

pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")

from lipmotion_studio.folder import open_folder
from studio.test_page import LIMIT_S, SCREENS, WELCOME, shown
from studio.toy_recordings import SENTENCES, write_recordings

pytestmark = [pytest.mark.long, NEEDED]


def test_a_voice_is_trained_and_used_from_the_page(tmp_path):
    project = tmp_path / "project"
    recordings = os.path.relpath(write_recordings(tmp_path / "recordings"), project)
    with open_folder(WELCOME, project) as folder:
        folder.change(lambda now: replace(now, recordings=recordings))
    with shown(tmp_path, project) as page:
        window = page.window
        window.click("#own")
        wait_until(lambda: window.text("#own-form"), LIMIT_S)
        window.run("const name = document.getElementById('own-name'); name.value = 'me'; name.oninput()")
        window.run("document.getElementById('own-prior').checked = false")
        window.click("#own-voice")
        wait_until(lambda: "%" in window.text("#own-job"), LIMIT_S)
        page.reload()  # the work goes on, and is told
        assert "Own voice" in window.text("#own")
        window.click("#own")
        wait_until(lambda: "is ready" in window.text("#own-job") or "could not" in window.text("#own-job"))
        report = window.text("#own-job")
        for told in (f"{SENTENCES - 1} recordings", "voices/me.lipmotion", "from the sound alone", "empty is not used"):
            assert told in report
        motion = "studio.store.motion?.values.slice(0, 300).join() ?? null"  # null: on its way
        before = page.of(motion)
        assert before
        window.click("#own-use")
        wait_until(lambda: "uses this voice" in window.text("#own-job"), LIMIT_S)
        wait_until(lambda: page.of(motion) not in (None, before), LIMIT_S)
        page.ready()
        check_screens(window, "own", SCREENS)
        window.run("const used = document.getElementById('own-choice'); used.value = ''; used.onchange()")
        wait_until(lambda: "Use this voice" in window.text("#own-job"), LIMIT_S)
        wait_until(lambda: page.of(motion) == before, LIMIT_S)
        page.ready()
