"""The studio's page in a real browser: each edit reaches the project, sound and face are in step, all can use it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from children import LIPMOTION, child, wait_until
from lipmotion.export.video import write_mp4
from lipmotion.pipeline.model import shipped_path
from lipmotion.speech.sound.audio_files import read_audio
from study.browser import (
    BROWSER,
    CONTROL,
    DELETE,
    DRIVER,
    ENTER,
    ESCAPE,
    MISSING,
    RIGHT,
    SHIFT,
    SPACE,
    TAB,
    UP,
    Browser,
    browser,
    check_screen,
)

pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")

from lipmotion.studio.votes import read_votes

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(BROWSER is None or DRIVER is None, reason=MISSING),
]
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"
SCREENS = ((1440, 900, "light"), (900, 800, "dark"), (320, 640, "light"), (320, 640, "dark"))
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--autoplay-policy=no-user-gesture-required")
LIMIT_S = 120.0
FRAME_S = 1 / 60
CLOSED = "document.querySelector('dialog').close()"
FAILED = "{ ...studio.store.line, status: 'failed', error: 'no speech' }"
READY = """const store = globalThis.studio?.store, line = store?.line;
return Boolean(line?.status === "ready" && line.id === store.lineId && store.weights && !store.saving &&
  studio.stage.head?.character);"""


@dataclass(frozen=True)
class Page:
    """A window with the page of a studio."""

    window: Browser

    def of(self, expression: str) -> Any:
        """Return what an expression of the page gives."""
        return self.window.run(f"return {expression}")

    def ready(self) -> None:
        """Wait until the line is shown, and every edit is on the disk."""
        wait_until(lambda: self.window.run(READY), LIMIT_S)

    @property
    def steps(self) -> list[str]:
        """The edits, as the page shows them."""
        return list(self.of("studio.store.line.steps"))

    def wait_for_steps(self, count: int) -> None:
        """Wait until the line has so many edits, and all that follows is done."""
        wait_until(lambda: len(self.steps) == count, LIMIT_S)
        self.ready()

    def middle(self, selector: str) -> tuple[float, float]:
        """The middle of an element [pixels]."""
        box = self.of(f"document.querySelector({selector!r}).getBoundingClientRect().toJSON()")
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def choose(self, number: int) -> None:
        """Click a phone, numbered from 1."""
        self.window.click(f'.phones [data-index="{number - 1}"]')

    def edit(self, act: Callable[[], object], sentence: str) -> None:
        """Act, and expect one more edit; ``sentence`` is a pattern of it."""
        before = self.steps
        act()
        self.wait_for_steps(len(before) + 1)
        after = self.steps
        assert after[:-1] == before
        assert re.fullmatch(sentence, after[-1]), after[-1]


@contextmanager
def served(folder: Path, *source: Path | str) -> Iterator[str]:
    """Give the address of a studio over a project in a folder; what follows a source are options."""
    command = [*LIPMOTION, "studio", *(source or [folder]), *(["-o", folder] if source else []), "--no-browser"]
    with child(command) as process:
        line = process.stdout.readline() if process.stdout else ""
        found = re.search(r"http://127\.0\.0\.1:\d+/#\S+", line)
        assert found, line
        yield found[0]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    folder = tmp_path_factory.mktemp("studio")
    (folder / "home").mkdir()
    with served(folder / "project", WELCOME) as address, browser(folder / "home", *WEBGL) as window:
        window.open(address)
        found = Page(window)
        found.ready()
        yield found


def test_each_edit_by_pointer_and_keys(page: Page) -> None:
    window = page.window

    def type_over(text: str) -> None:
        window.press(ENTER)
        window.press(*text, ENTER)

    page.choose(11)
    x, y = page.middle('.border[data-before="10"]')
    page.edit(lambda: window.drag((x, y), (x + 6, y), (x + 12, y)), r"phone 11 ends 1\.\d+")
    window.press(TAB)
    assert page.of("studio.store.selected.index") == 11
    page.edit(lambda: window.press_together(SHIFT, RIGHT), r"phone 12 ends 1\.\d+")
    page.edit(lambda: type_over("n"), "phone 12 is n")
    page.edit(lambda: window.press("s"), r"split phone 12 at 1\.\d+")
    page.edit(lambda: window.press("m"), "remove phone 14")
    page.edit(lambda: window.press(DELETE), "remove phone 13")
    page.choose(12)
    window.press(UP)
    number = page.of("studio.store.selected.index") + 1
    assert page.of("studio.store.selected.kind") == "word"
    page.edit(lambda: type_over("the"), f"word {number} is the")
    page.edit(lambda: window.press("f"), r"hold from \S+ to \S+")
    page.edit(lambda: window.press("g"), r"lock from \S+ to \S+")
    page.edit(lambda: window.click("#unlock"), r"unlock from \S+ to \S+")
    page.edit(lambda: window.click("#insert"), r"insert ah from \S+ to \S+")
    page.edit(lambda: window.click("#gain-apply"), r"gain \S+ from \S+ to \S+")
    page.edit(lambda: window.click("#mood-set"), r"mood happy:0\.7 at \S+")
    window.press(ESCAPE, "d")
    x, y = page.middle('.curve[data-channel="opening"]')
    way = [(x + 10 * step, y - 2 * step) for step in range(1, 6)]
    page.edit(lambda: window.drag((x, y), *way), r"draw opening (\S+ ){3,}from \S+ to \S+")
    page.edit(lambda: window.drag((x - 90, y)), r"pin opening \S+ at \S+")
    window.press("d")
    window.click("#tab-delivery")
    page.edit(lambda: window.click("#set-stepped"), "set stepped true")
    made = page.steps
    for count in reversed(range(len(made))):
        window.press_together(CONTROL, "z")
        page.wait_for_steps(count)
    for count in range(len(made)):
        window.press_together(CONTROL, SHIFT, "z")
        page.wait_for_steps(count + 1)
    assert page.steps == made
    assert [each for each in window.problems() if each.startswith("SEVERE") and "favicon" not in each] == []


def test_sound_and_face_are_in_step(page: Page) -> None:
    wait_until(lambda: page.of("studio.weights.exact"), LIMIT_S)
    page.window.press(ESCAPE, ESCAPE)
    page.window.run(
        """const { head } = studio.stage, posed = head.pose.bind(head);
        globalThis.offsets = [];
        head.pose = (weights, time_s) => {
          if (studio.store.playing) offsets.push(studio.player.audio.currentTime - time_s);
          posed(weights, time_s);
        };"""
    )
    page.window.press(SPACE)
    wait_until(lambda: page.of("offsets.length") > 5, LIMIT_S)
    page.window.press(SPACE)
    assert page.of("studio.player.audio.paused")
    assert max(map(abs, page.of("offsets"))) <= FRAME_S


def test_a_dropped_line_is_read_corrected_and_exported(tmp_path: Path) -> None:
    said = WELCOME.with_suffix(".txt").read_text(encoding="utf-8")
    (tmp_path / "home").mkdir()
    with served(tmp_path / "project", WELCOME) as address, browser(tmp_path / "home", *WEBGL) as window:
        window.open(address)
        page = Page(window)
        page.ready()
        window.run(
            """studio.server.bytes(`lines/${studio.store.lineId}/sound.wav`).then((sound) => studio.add(
              [new File([sound], "second.wav"), new File([arguments[0]], "second.txt")]));""",
            said,
        )
        wait_until(lambda: window.text("#title").endswith("second"), LIMIT_S)
        page.ready()
        assert page.of("studio.store.line.words[1].label") == "speak"
        window.click('.words [data-index="1"]')
        window.run("document.getElementById('word-phones').value = 's p iy k s'")
        window.click("#word-keep")
        wait_until(lambda: "s p iy k s" in window.text("#offers"), LIMIT_S)
        page.edit(lambda: window.click("#word-change"), "word 2 is speak said s p iy k s")
        window.press(ESCAPE, ESCAPE, "a")
        wait_until(lambda: page.of("studio.store.lines.at(-1).mark") == "approved", LIMIT_S)
        window.run("document.getElementById('transcript').value += ' now'")
        page.edit(lambda: window.click("#align"), r"say please .* now from \S+ to \S+")
        window.click("#export")
        window.click("#export-approved")
        wait_until(lambda: "Written" in window.text("dialog"), LIMIT_S)
        wait_until(lambda: page.of("studio.store.lines.at(-1).exported") == "yes", LIMIT_S)


def test_what_another_window_did_is_shown(page: Page) -> None:
    before = page.steps
    page.window.run_until_done(
        """const done = arguments[0], { server, store } = studio;
        const content = { revision: store.line.revision, steps: ["set intensity 1.1"] };
        server.told(`lines/${store.lineId}/edits`, content).then(() => done());"""
    )
    page.window.click("#tab-edit")
    page.window.click("#mood-set")
    wait_until(lambda: "another window" in page.window.text("#message"), LIMIT_S)
    page.ready()
    assert page.steps == [*before, "set intensity 1.1"]


def test_ten_thousand_lines_scroll(page: Page) -> None:
    page.window.run(
        """const [line] = studio.store.lines;
        const made = (_, n) => ({ ...line, id: n + 1, name: `line ${n}`, doubt: (n * 7919 % 997) / 997 });
        studio.store.set({ lines: Array.from({ length: 10000 }, made) });"""
    )
    wait_until(lambda: "10000" in page.window.text(".count"), LIMIT_S)
    page.window.run("document.querySelector('.view').scrollTop = 150000")
    wait_until(lambda: "line 5000" in page.window.text(".view"), LIMIT_S)
    assert page.of("document.querySelectorAll('.line').length") < 100
    page.window.run("const order = document.querySelector('#queue select'); order.value = 'doubt'; order.onchange()")
    shown = page.of("studio.queue.lines.slice(0, 50).map(({ doubt }) => doubt)")
    assert shown == sorted(shown, reverse=True)


def test_every_screen(page: Page) -> None:
    window = page.window
    states: tuple[tuple[str, str], ...] = (
        ("phone", "studio.choose('phone', 8); studio.showPlace('panel')"),
        ("word", "studio.choose('word', 3)"),
        ("delivery", "studio.store.set({ tab: 'delivery' })"),
        ("why", "studio.store.set({ tab: 'why' })"),
        ("history", "studio.store.set({ tab: 'history' })"),
        ("lines", "studio.showPlace('lines')"),
        ("timeline", "studio.showPlace('stage')"),
        ("keys", "studio.help()"),
        ("export", f"{CLOSED}; document.getElementById('export').click()"),
        ("failed", f"{CLOSED}; studio.store.set({{ line: {FAILED} }})"),
        ("empty", "studio.store.set({ lines: [], line: null, lineId: '' })"),
    )  # fmt: skip
    for width, height, scheme in SCREENS:
        window.run("location.reload()")
        page.ready()
        window.show_as(width, height, scheme, mobile=width < 600)
        for name, act in states:
            window.run(act)
            window.run_until_done("setTimeout(arguments[0], 100)")
            check_screen(window, name, width, scheme)
    window.show_as(1200, 900)


def test_a_killed_studio_has_every_edit(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    with ExitStack() as stack:
        window = stack.enter_context(browser(tmp_path / "home", *WEBGL))
        shown = Page(window)
        with served(tmp_path / "project", WELCOME) as address:
            window.open(address)
            shown.ready()
            shown.choose(3)
            shown.edit(lambda: window.press("s"), r"split phone 3 at \S+")
            steps = shown.steps
        window.open("about:blank")
        with served(tmp_path / "project") as address:
            window.open(address)
            shown.ready()
            assert shown.steps == steps
            window.press_together(CONTROL, "z")
            wait_until(lambda: shown.steps == [], LIMIT_S)


def test_the_real_video_beside_and_comparisons(tmp_path: Path, filmed_face_file: Path) -> None:
    (tmp_path / "home").mkdir()
    sound = Path(shutil.copy(WELCOME, tmp_path))
    pictures = (np.full((64, 96, 3), 40 + number % 200, np.uint8) for number in range(100))
    write_mp4(sound.with_suffix(".mp4"), pictures, fps=25, audio=read_audio(sound))
    options = ("--against", shipped_path(), "--face", filmed_face_file)
    with served(tmp_path / "project", sound, *options) as address, browser(tmp_path / "home", *WEBGL) as window:
        window.open(address)
        page = Page(window)
        page.ready()
        window.press("x")
        wait_until(lambda: page.of("document.querySelector('.recorded').readyState") >= 2, LIMIT_S)
        window.run("studio.player.seek(1.23)")
        wait_until(lambda: page.of("!document.querySelector('.recorded').seeking"), LIMIT_S)
        assert abs(page.of("document.querySelector('.recorded').currentTime") - 1.23) <= 1 / 25
        window.click("#tab-history")
        window.click("#compare-model")
        wait_until(lambda: page.of("Boolean(studio.store.other?.weights)"), LIMIT_S)
        window.click("#compare-sides")
        assert page.of("studio.stage.head.pair.length") == 2
        for width, height, scheme in SCREENS:
            window.show_as(width, height, scheme, mobile=width < 600)
            window.run("studio.showPlace('panel')")
            window.run_until_done("setTimeout(arguments[0], 100)")
            check_screen(window, "compared", width, scheme)
        window.show_as(1440, 900, "light", mobile=False)
        window.run("studio.store.set({ span: { start_s: 0.5, end_s: 0.8 } })")
        window.click("#compare-blind")
        assert not page.of("studio.store.sideBySide")
        wait_until(lambda: page.of("studio.store.blind.asked"), LIMIT_S)
        wait_until(lambda: not page.of("document.getElementById('blind-better-A').disabled"), LIMIT_S)
        window.click("#blind-better-A")
        wait_until(lambda: "A was" in window.text("#blind-told"), LIMIT_S)
        (vote,) = read_votes(tmp_path / "project" / "votes.json")
        assert vote.better == vote.shown[0]
        assert vote.shown[0] in window.text("#blind-told").partition(", B was")[0]
        window.run("studio.store.set({ face: 'toy', mesh: '' })")
        wait_until(lambda: "filmed" in window.text("#stage .note"), LIMIT_S)
        check_screen(window, "filmed", 1440, "light")
        assert [each for each in window.problems() if each.startswith("SEVERE") and "favicon" not in each] == []
