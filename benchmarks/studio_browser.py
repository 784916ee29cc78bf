"""The studio's page measured in Chromium: first picture, edits by keys, scrolling, memory.

WebGL is drawn by the processor here (SwiftShader, llvmpipe), as on a machine without a graphics card. Times are of the
clock, beside them processor time of the server and of all processes of the browser: compare both before believing one.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from children import wait_until
from studio.served import Served
from study.browser import ENTER, Browser, browser

WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
LIMIT_S = 600.0
SCROLLED_S = 5.0
LABELS = "p m f aa iy uw".split()
FIRST = """window.first_ms = 0;
const look = () => {
  const { studio } = window, drawn = studio?.stage.head?.character && studio.store.weights;
  if (drawn && studio.weights.known(studio.store.time_s)) window.first_ms = performance.now();
  else requestAnimationFrame(look);
};
look();
addEventListener("keydown", (event) => { window.pressed_ms = event.timeStamp; }, true);"""
MOVED = """const made = performance.getEntriesByName("edit to face");
return [made.length, made.length ? made.at(-1).startTime + made.at(-1).duration - window.pressed_ms : 0];"""
SCROLL = """const [seconds] = arguments, { timeline } = window.studio, began_ms = performance.now(), steps = [];
let before_ms = 0;
window.steps = null;
const step = (now_ms) => {
  if (before_ms) steps.push(now_ms - before_ms);
  before_ms = now_ms;
  const next_px = timeline.left_px + 30, last_px = timeline.duration_s * timeline.px_s - timeline.width;
  timeline.scrollTo(next_px >= last_px ? 0 : next_px);
  if (now_ms - began_ms < 1000 * seconds) requestAnimationFrame(step);
  else window.steps = steps;
};
requestAnimationFrame(step);"""


def measured_page(server: Served, folder: Path, edits: int) -> dict[str, Any]:
    """Return what is measured of the first line of a studio in a browser.

    folder : a new one, for the profile of the browser
    edits  : so many phones are typed over
    """
    folder.mkdir()
    with browser(folder, *WEBGL) as window:
        window.open("about:blank")
        empty_mb = memory_mb(server)
        window.open(f"http://127.0.0.1:{server.port}/#{server.token}")
        window.run(FIRST)
        wait_until(lambda: window.run("return window.first_ms"), LIMIT_S)
        found: dict[str, Any] = {"first picture, s": round(window.run("return window.first_ms") / 1000, 2)}
        wait_until(lambda: window.run("return !studio.store.saving && Boolean(studio.store.motion)"), LIMIT_S)
        found |= typed_edits(window, server, edits)
        window.run(SCROLL, SCROLLED_S)
        wait_until(lambda: window.run("return Boolean(window.steps)"), LIMIT_S)
        steps_ms = np.array(window.run("return window.steps"))
        found["frames a second while the timeline scrolls"] = round(1000 / float(steps_ms.mean()), 1)
        found["between two of these, ms"] = shares(steps_ms)
        return found | {"memory of the page, MB": round(memory_mb(server) - empty_mb)}


def typed_edits(window: Browser, server: Served, count: int) -> dict[str, Any]:
    """Return the time from key to face, and what both sides computed, of edits by keys; the first two do not count."""
    chance, rows = Random(3), []  # noqa: S311
    for number in range(count + 2):
        phones = window.run("return studio.store.recording.phones.map(({ label }) => label)")
        place = chance.randrange(2, len(phones) - 2)
        label = chance.choice([each for each in LABELS if each != phones[place]])
        window.run("studio.choose('phone', arguments[0]); studio.timeline.scroller.focus()", place)
        wait_until(lambda: window.run("return studio.weights.known(studio.store.time_s)"), LIMIT_S)
        before, spent = window.run(MOVED)[0], [processor_ms(pids) for pids in sides(server)]
        window.press(ENTER)
        window.press(*label, ENTER)
        wait_until(lambda before=before: window.run(MOVED)[0] > before, LIMIT_S)  # type: ignore[misc]
        after = [processor_ms(pids) for pids in sides(server)]
        wait_until(lambda: not window.run("return studio.store.saving"), LIMIT_S)
        if number >= 2:
            rows.append((window.run(MOVED)[1], *(end - start for start, end in zip(spent, after, strict=True))))
    names = ("from the last key to the moved face, ms", "of the server's processor, ms", "of the browser's, ms")
    return {name: shares(np.array(column)) for name, column in zip(names, zip(*rows, strict=True), strict=True)}


def shares(values: np.ndarray[Any, Any]) -> list[float]:
    """Return the median, and what 95 % are below."""
    return [round(float(np.percentile(values, share)), 1) for share in (50, 95)]


def sides(server: Served) -> tuple[set[int], set[int]]:
    """Return the processes of a server, and those of the browser: what else this process has started."""
    own = set(started_by(server.process.pid))
    return own, set(started_by(os.getpid())) - own - {os.getpid()}


def started_by(first: int) -> Iterator[int]:
    """Yield a process, and those that it has started."""
    parents: dict[int, list[int]] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents.setdefault(int(path.read_text().rpartition(")")[2].split()[1]), []).append(int(path.parent.name))
        except OSError:  # it has ended
            continue
    waiting = [first]
    while waiting:
        number = waiting.pop()
        yield number
        waiting += parents.get(number, [])


def processor_ms(processes: set[int]) -> float:
    """Return what processes have taken of the processor."""
    ticks = 0
    for number in processes:
        try:
            ticks += sum(map(int, Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]))
        except OSError:
            continue
    return 1000 * ticks / os.sysconf("SC_CLK_TCK")


def memory_mb(server: Served) -> float:
    """Return the memory of the browser; what processes share is divided among them."""
    kilobytes = 0
    for number in sides(server)[1]:
        try:
            rows = Path(f"/proc/{number}/smaps_rollup").read_text().splitlines()
        except OSError:
            continue
        kilobytes += sum(int(row.split()[1]) for row in rows if row.startswith("Pss:"))
    return kilobytes / 1024


def settled_load() -> str:
    """Return the load of this machine, and its processors, as a stamp says them."""
    return f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} at {time.strftime('%H:%M')}"
