"""How fast the server of a study takes answers, and whether kills lose any; over HTTP on loopback, bounded.

python benchmarks/study_server.py [--answers 10000] [--kills 50] [--page] [-o FILE.json]

Raters are programs: nobody watches anything. ``--page`` also loads the page of a study of 36 videos in Chromium, and
measures the time from the navigation to the first trial that can be played.
"""

from __future__ import annotations

import argparse
import json
import sqlite3
import sys
import tempfile
import time
from contextlib import ExitStack, closing
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "src")]

from lipmotion_studio.study.store import ANSWERS  # noqa: E402
from study.served import ScriptedRater, served  # noqa: E402
from study.small_study import small_study  # noqa: E402

TOGETHER = 40
"""Raters at the same time."""
LOADS = 10


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--answers", type=int, default=10_000)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--page", action="store_true")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.output.parent if options.output else None) as name:
        folder = Path(name)
        figures = {"speed": speed(folder, options.answers), "kills": kills(folder, options.kills)}
        if options.page:
            figures["page"] = page(folder)
    text = json.dumps(figures, indent=1)
    print(text)
    if options.output:
        options.output.write_text(text + "\n", encoding="utf-8")


def speed(folder: Path, wanted: int) -> dict[str, float]:
    """Return how many answers a second are acknowledged to 40 raters at once; each comes to its end."""
    study = small_study(folder / "fast")
    answers = 0
    seconds = 0.0
    with served(folder / "fast", folder / "fast.txt") as server:
        while answers < wanted:
            raters = [ScriptedRater(study, server.port, number) for number in range(TOGETHER)]
            started_s = time.perf_counter()
            answers += finished(raters)
            seconds += time.perf_counter() - started_s
            time.sleep(TOGETHER / 5)  # the limit on new raters fills again; outside of the measured time
        server.kill()
    assert stored(folder / "fast") == answers
    return {"answers": answers, "seconds": round(seconds, 2), "answers_a_second": round(answers / seconds, 1)}


def kills(folder: Path, count: int) -> dict[str, int]:
    """Kill the server again and again while 20 raters answer; return what was acknowledged, lost, and stored twice."""
    acknowledged = lost = twice = done = 0
    while done < count:
        part = folder / f"killed{done}"
        study = small_study(part)
        with ExitStack() as stack:
            server = stack.enter_context(served(part, folder / "killed.txt"))
            raters = [ScriptedRater(study, server.port, number, 0.05) for number in range(20)]
            for rater in raters:
                rater.start()
            while done < count and any(rater.is_alive() for rater in raters):
                time.sleep(0.25 + 0.01 * (done % 7))
                server.kill()
                done += 1
                server = stack.enter_context(served(part, folder / "killed.txt", server.port))
            acknowledged += finished(raters, started=True)
            server.kill()
        lost_here, twice_here = faults(part, raters)
        lost, twice = lost + lost_here, twice + twice_here
    assert "Traceback" not in (folder / "killed.txt").read_text(encoding="utf-8")
    return {"kills": done, "acknowledged": acknowledged, "lost": lost, "stored_twice": twice}


def finished(raters: list[ScriptedRater], *, started: bool = False) -> int:
    """Wait for raters, and return how many answers were acknowledged to them."""
    for rater in raters if not started else ():
        rater.start()
    for rater in raters:
        rater.join(300)
        assert rater.failure is None, rater.failure
    return sum(len(rater.acknowledged) for rater in raters)


def faults(folder: Path, raters: list[ScriptedRater]) -> tuple[int, int]:
    """Return how many acknowledged answers are not in the database as they were given, and how many are there twice."""
    from lipmotion_studio.study.store import StudyStore

    with closing(sqlite3.connect(folder / ANSWERS)) as database:
        rows = database.execute("SELECT rater, trial, value FROM answers").fetchall()
    values = {(rater, trial): value for rater, trial, value in rows}
    with closing(StudyStore(folder)) as store:
        numbers = [store.find_rater(rater.token) for rater in raters]
    lost = sum(
        values.get((number, trial)) != value
        for rater, number in zip(raters, numbers, strict=True)
        for trial, value in rater.acknowledged.items()
    )
    return lost, len(rows) - len(values)


def stored(folder: Path) -> int:
    """Return how many answers a database has."""
    with closing(sqlite3.connect(folder / ANSWERS)) as database:
        return int(database.execute("SELECT count(*) FROM answers").fetchone()[0])


def page(folder: Path) -> dict[str, float]:
    """Return the time until the page of a study of 36 videos can be used: to consent, and to play the first trial."""
    import numpy as np

    from lipmotion.types import Audio
    from lipmotion_faces.video.mp4 import write_mp4
    from lipmotion_studio.study.answers import MOS
    from lipmotion_studio.study.design import design_study
    from lipmotion_studio.study.settings import StudySettings
    from study.browser import browser
    from study.test_page import wait_for

    noise = np.random.default_rng(30)
    sound = Audio(noise.normal(0, 0.05, 48_000).astype(np.float32), 16_000)
    for source in ("a", "b"):
        (folder / source).mkdir()
        for n in range(18):
            frames = [noise.integers(0, 255, (36, 36, 3), np.uint8).repeat(16, 0).repeat(16, 1) for _ in range(75)]
            write_mp4(folder / source / f"s{n}.mp4", frames, fps=25, audio=sound)
    study = design_study(
        folder / "page", MOS, [f"a={folder / 'a'}", f"b={folder / 'b'}"], [folder / "a"], StudySettings(anchors=0)
    )
    size = sum(path.stat().st_size for path in (folder / "page" / "videos").iterdir())
    (folder / "home").mkdir()
    interactive, playable = [], []
    with served(folder / "page", folder / "page.txt") as server, browser(folder / "home") as window:
        for n in range(LOADS):
            window.cdp("Network.clearBrowserCache")
            window.open("about:blank")
            window.open(f"http://127.0.0.1:{server.port}/?{n}")
            wait_for(window, "welcome")
            interactive.append(window.run("return performance.getEntriesByName('interactive')[0].startTime"))
            window.click("#agree")
            wait_for(window, "guide")
            began_ms = window.run("document.getElementById('begin').click(); return performance.now()")
            ready = "const done = arguments[0]; const v = document.querySelector('video');"
            ready += "const tell = () => done(performance.now());"
            ready += "v.readyState >= 3 ? tell() : v.addEventListener('canplay', tell, { once: true });"
            playable.append(window.run_until_done(ready) - began_ms)
    return {
        "videos": len(study.videos),
        "megabytes": round(size / 1e6, 1),
        "interactive_ms_median": round(median(interactive), 1),
        "interactive_ms_most": round(max(interactive), 1),
        "playable_ms_most": round(max(playable), 1),
    }


if __name__ == "__main__":
    main()
