"""The page in a real browser: videos play, keys work, answers land, nobody is kept out."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from children import wait_until
from lipmotion.types import Audio
from lipmotion_studio.study import manifest, store
from lipmotion_studio.study.answers import MOS, PAIRED, Answer
from study.browser import ENTER, LEFT, NEEDED, RIGHT, SPACE, Browser, browser, check_screens
from study.served import Server, served
from study.small_study import CONDITIONS, planned, sha256_of
from testing.toy import write_film

pytest.importorskip("uvicorn", reason="the extra 'study' is not installed")
pytestmark = [pytest.mark.long, NEEDED]
SCREENS = ((1200, 900, "light"), (1200, 900, "dark"), (320, 640, "light"), (320, 640, "dark"))
LIMIT_S = 60.0


def shown_study(folder: Path, kind: str) -> manifest.Study:
    """Write a study of one sentence, whose videos are real and short."""
    (folder / manifest.VIDEOS).mkdir(parents=True)
    sound = Audio(np.sin(np.arange(8000) * 0.17).astype(np.float32) * 0.2, 16_000)
    videos = []
    for n, condition in enumerate((*CONDITIONS, "anchor")):
        frames = [np.full((120, 160, 3), (60 * n, 16 * step, 128), np.uint8) for step in range(12)]
        path = folder / manifest.VIDEOS / "made.mp4"
        write_film(path, frames, sound)
        digest = sha256_of(path)
        path.rename(path.with_name(f"{digest[:32]}.mp4"))
        videos.append(manifest.StudyVideo(f"{digest[:32]}.mp4", "one", condition, 0.5, digest, {"made": "test"}))
    return planned(folder, kind, ("one",), videos)


@contextmanager
def at_work(tmp_path: Path, kind: str) -> Iterator[tuple[Browser, Server, manifest.Study]]:
    study = shown_study(tmp_path / "study", kind)
    (tmp_path / "home").mkdir()
    with served(tmp_path / "study", tmp_path / "errors.txt") as server, browser(tmp_path / "home") as window:
        window.open(f"http://127.0.0.1:{server.port}/")
        wait_for(window, "welcome")
        yield window, server, study


def wait_for(window: Browser, part: str) -> None:
    wait_until(lambda: window.run("return document.getElementById(arguments[0])?.hidden === false", part), LIMIT_S)


def is_open(window: Browser) -> bool:
    return window.text("#status") == "You can answer now."


def done(window: Browser) -> int:
    return int(window.run("return document.getElementById('thanks').hidden ? progress.value : 99"))


def join(window: Browser) -> None:
    window.click("#agree")
    wait_for(window, "guide")
    window.click("#begin")
    wait_for(window, "trial")


def answer(window: Browser, act: Callable[[], object]) -> None:
    """Play what is shown by the space bar, answer it, and wait for the next page."""
    before = done(window)
    assert window.run("return document.getElementById('next').disabled")
    window.press(SPACE)
    wait_until(lambda: is_open(window), LIMIT_S)
    act()
    wait_until(lambda: not window.run("return document.getElementById('next').disabled"), LIMIT_S)
    window.press(ENTER)
    wait_until(lambda: done(window) > before, LIMIT_S)


def take_part(window: Browser, study: manifest.Study, act: Callable[[], object]) -> None:
    for _ in study.trials:
        answer(window, act)
    wait_for(window, "thanks")


def answers(tmp_path: Path) -> list[Answer]:
    return [row for row in store.collect_answers(tmp_path / "study") if not row.practice]


def test_pairs_by_keys(tmp_path):
    with at_work(tmp_path, PAIRED) as (window, _, study):
        check_screens(window, "welcome", SCREENS)
        window.click("#agree")
        wait_for(window, "guide")
        check_screens(window, "guide", SCREENS)
        window.click("#begin")
        wait_for(window, "trial")
        check_screens(window, "pair", SCREENS)
        keys = iter("12" + LEFT + RIGHT + "12" * len(study.trials))
        answer(window, lambda: window.press(next(keys)))
        for _ in study.trials[1:]:
            window.press("2")  # before the videos were played: nothing is chosen
            answer(window, lambda: window.press(next(keys)))
        wait_for(window, "thanks")
        check_screens(window, "thanks", SCREENS)
        assert [each for each in window.problems() if "favicon" not in each] == []
    rows = answers(tmp_path)
    assert [row.value for row in sorted(rows, key=lambda row: row.trial)][:4] == ["second", "first", "second", "first"]
    assert len(rows) == len(study.trials) - 1
    assert all(row.plays == 2 and row.seconds >= 0.9 for row in rows)


def test_opinions_by_keys(tmp_path):
    with at_work(tmp_path, MOS) as (window, _, study):
        join(window)
        check_screens(window, "opinions", SCREENS)
        take_part(window, study, lambda: window.press("1", "2", "3", "4", "5"))
    values = {row.question: row.value for row in answers(tmp_path)}
    assert values == {"smoothness": "1", "closure": "2", "protrusion": "3", "turning": "4", "overall": "5"}


def test_an_answer_outlives_the_server_and_the_page(tmp_path):
    """The server is killed before an answer comes; the page keeps it, sends it again, and also after a reload."""
    with ExitStack() as stack:
        window, server, _ = stack.enter_context(at_work(tmp_path, PAIRED))
        join(window)
        answer(window, lambda: window.press("1"))
        link = window.run("return location.href")
        for reloads in (False, True):
            before = done(window)
            window.press(SPACE)
            wait_until(lambda: is_open(window), LIMIT_S)
            server.kill()
            window.press("2", ENTER)
            wait_until(lambda: "Nothing is lost" in window.text("#status"), LIMIT_S)
            if reloads:
                window.open("about:blank")
            server = stack.enter_context(served(tmp_path / "study", tmp_path / "errors.txt", server.port))
            if reloads:
                window.open(link)
                wait_for(window, "trial")
            wait_until(lambda before=before: done(window) == before + 1, LIMIT_S)  # type: ignore[misc]
            assert [row.value for row in answers(tmp_path)] == ["second"] * before
    assert "Traceback" not in (tmp_path / "errors.txt").read_text(encoding="utf-8")
