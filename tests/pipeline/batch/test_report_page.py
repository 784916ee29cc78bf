import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from children import wait_until
from lipmotion.pipeline.batch import BatchLine
from lipmotion.pipeline.batch.ledger import Place, open_ledger
from lipmotion.pipeline.batch.report import Mark, read_marks, write_reports
from lipmotion.types import Audio
from lipmotion_faces.video.mp4 import write_mp4
from study.browser import BROWSER, DRIVER, MISSING, SPACE, Browser, browser, check_screens

pytestmark = [pytest.mark.long, pytest.mark.skipif(BROWSER is None or DRIVER is None, reason=MISSING)]
SCREENS = ((1200, 800, "light"), (1200, 800, "dark"), (320, 640, "light"), (320, 640, "dark"))
LINES = 10_000
FOUND = {
    "outcome": "done", "words": "transcript", "confidence": 0.95, "range_db": 41.5, "duration_s": 0.5, "seconds": 0.1,
}  # fmt: skip
FOUND |= {"run": "1", "fingerprint": "f", "inputs": [], "closures_heard": 2, "closures_made": 2, "widest": 0.21}
LIMIT_S = 60.0


@pytest.fixture
def window(tmp_path: Path) -> Iterator[Browser]:
    (tmp_path / "home").mkdir()
    with browser(tmp_path / "home") as opened:
        opened.cdp("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
        yield opened


def report(folder: Path, speech: Path, count: int, *, film: bool) -> Path:
    """Write a report of a real sound, the first line the most doubtful one; return its path."""
    (folder / "sounds").mkdir()
    out = folder / "out"
    (out / "act").mkdir(parents=True)
    tone = np.sin(np.arange(8000) * 0.17).astype(np.float32) * 0.2
    shutil.copy(speech, folder / "sounds" / "a #1.wav")
    kind = "mp4" if film else "json"
    lines = [BatchLine(f"act/line{n:05}", str(folder / "sounds" / "a #1.wav")) for n in range(count)]
    if film:
        frames = [np.full((120, 160, 3), (200, 16 * step, 128), np.uint8) for step in range(12)]
        for line in lines:
            write_mp4(out / f"{line.name}.mp4", frames, fps=25, audio=Audio(tone, 16_000))
    with open_ledger(Place(str(out), "1"), lines) as ledger:
        for n, line in enumerate(lines):
            record = FOUND | {"name": line.name, "recording": line.recording, "outputs": {f"{line.name}.{kind}": "0"}}
            warnings = {"warnings": [f"word {n} is not said"] * (3 - n)} if n < 3 else {}
            ledger.append(record | warnings)
        return write_reports(lines, ledger, out, {"act/line00001": Mark("approve", "before")})[1]


def chosen(window: Browser) -> str:
    return window.text("#name").partition(",")[0]


def until(window: Browser, script: str) -> None:
    wait_until(lambda: window.run(f"return {script}"), LIMIT_S)


def test_ten_thousand_lines_are_heard_and_marked(window, toy_speech, tmp_path):
    page = report(tmp_path, toy_speech, LINES, film=False)
    window.open(page.as_uri())
    assert "10000 of 10000 lines, 0 failed, 1 approved, 0 to redo" in window.text("#count")
    assert window.run("return document.querySelectorAll('#rows .row').length") < 100
    assert chosen(window) == "act/line00000"
    window.press(SPACE)
    until(window, "player.ended || player.currentTime > 0")
    window.press("a", "j", "a", "j", "r", "j", "j", "k")
    assert chosen(window) == "act/line00003"
    assert "1 approved, 1 to redo" in window.text("#count")
    check_screens(window, "lines", SCREENS)
    window.run("view.scrollTop = body.offsetHeight")
    until(window, "[...list.children].some(row => row.textContent.includes('line09999'))")
    window.open(page.as_uri())  # what is not saved is kept in the browser
    assert "1 approved, 1 to redo" in window.text("#count")
    window.click("#save")
    wait_until((tmp_path / "marks.csv").is_file, LIMIT_S)
    marks = read_marks(tmp_path / "marks.csv")
    assert {name: mark.kind for name, mark in marks.items()} == {
        "act/line00000": "approve", "act/line00001": "", "act/line00002": "redo",
    }  # fmt: skip
    assert window.problems() == []


def test_videos_of_lines_are_seen(window, toy_speech, tmp_path):
    window.open(report(tmp_path, toy_speech, 6, film=True).as_uri())
    until(window, "list.querySelector('video').videoWidth === 160")
    window.press("j", SPACE)
    until(window, "player.videoWidth === 160 && player.currentTime > 0")
    assert window.run("return player.src").endswith("act/line00001.mp4")
    window.run("document.getElementById('filter').value = 'line00004'; choose()")
    assert chosen(window) == "act/line00004"
    window.run("document.getElementById('filter').value = ''; choose()")
    until(window, "[...list.querySelectorAll('video')].every(each => each.readyState >= 2)")
    check_screens(window, "videos", SCREENS)
    assert window.problems() == []
