"""The studio's page in a real browser: each edit reaches the project, sound and face are in step, all can use it."""

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from children import wait_until
from lipmotion import load_model, read_motion, save_model
from lipmotion.pipeline.model import find_shipped
from studio.served import served
from studio.test_recorded_videos import shifted
from study import browser

pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")
from testing.toy import write_film

pytestmark = [pytest.mark.long, browser.NEEDED]
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"
SCREENS = ((1440, 900, "light"), (900, 800, "dark"), (320, 640, "light"))
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--autoplay-policy=no-user-gesture-required")
LIMIT_S = 120.0
GHOST_PIXELS = """(() => { const { width, height } = studio.stage.ghost;
  const { data } = studio.stage.ghost.getContext("2d").getImageData(0, 0, width, height);
  return data.reduce((count, value, n) => count + (n % 4 === 3 && value > 0), 0); })()"""
"""How many pixels of the other head are drawn over the first one."""
FRAME_S = 1 / 60
CLOSED = "document.querySelector('dialog').close()"
FAILED = "{ ...studio.store.recording, status: 'failed', error: 'no speech' }"
ASKED = """return performance.getEntriesByType("resource").map(({ name }) => new URL(name))
  .filter(({ pathname }) => pathname.endsWith("/motion"))
  .map(({ searchParams }) => ["of", "names", "by"].map((name) => searchParams.get(name)).join(" "))"""
"""Which curves were asked for: of which kind, by which model."""
NOT_SHOWN = "studio.store.recording.channels.find(({ name }) => !studio.store.channels.includes(name)).name"
READY = """const store = globalThis.studio?.store, line = store?.recording;
return Boolean(line?.status === "ready" && line.id === store.recordingId && store.weights && !store.saving &&
  studio.stage.head?.character);"""


@dataclass(frozen=True)
class Page:
    """A window with the page of a studio.

    project : its folder
    """

    window: browser.Browser
    project: Path

    def of(self, expression: str) -> Any:
        return self.window.run(f"return {expression}")

    def ready(self) -> None:
        wait_until(lambda: self.window.run(READY), LIMIT_S)

    @property
    def steps(self) -> list[str]:
        return list(self.of("studio.store.recording.steps"))

    def reload(self) -> None:
        self.window.run("document.documentElement.dataset.old = 'yes'; location.reload()")
        wait_until(lambda: self.of("document.documentElement?.dataset.old === undefined"), LIMIT_S)
        self.ready()

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
        selector = f'.phones [data-index="{number - 1}"]'
        wait_until(lambda: self.of(f"Boolean(document.querySelector({selector!r}))"), LIMIT_S)
        self.window.click(selector)

    def edit(self, act: Callable[[], object], sentence: str) -> None:
        """Act, and expect one more edit; ``sentence`` is a pattern of it."""
        before = self.steps
        act()
        self.wait_for_steps(len(before) + 1)
        after = self.steps
        assert after[:-1] == before
        assert re.fullmatch(sentence, after[-1]), after[-1]


@contextmanager
def shown(folder: Path, source: Path = WELCOME, *options: Path | str) -> Iterator[Page]:
    """Give the page of a studio of one recording, or of a project, in a browser; its project is in the folder."""
    (folder / "home").mkdir()
    place = () if source == folder / "project" else ("-o", folder / "project")
    studio = served(source, folder / "errors.txt", *place, *options, limit_s=browser.WINDOW_S)
    with studio as server, browser.browser(folder / "home", *WEBGL) as window:
        window.open(f"http://127.0.0.1:{server.port}/#{server.token}")
        page = Page(window, folder / "project")
        page.ready()
        yield page


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with shown(tmp_path_factory.mktemp("studio")) as page:
        yield page


@pytest.fixture
def page(opened: Page) -> Page:
    """A page that all tests share, as it is at first, without edits."""
    opened.reload()
    while opened.steps:
        count = len(opened.steps)
        opened.window.press_together(browser.CONTROL, "z")
        opened.wait_for_steps(count - 1)
    return opened


PIN = """const tracks = studio.timeline.tracks.at(-1), row = tracks.rows.get("opening");
  const step = studio.store.recording.steps.findLast((step) => step.startsWith("pin opening"));
  const [, value, time_s] = /^pin opening (\\S+) at ([^ ]+)/.exec(step);
  const pin = { channel: "opening", value: +value, time_s: +time_s, slope: null };
  const { left, top } = row.element.getBoundingClientRect();
  return [studio.timeline.x(pin.time_s), tracks.y(row, pin.value), ...tracks.ends(row, pin)[1]]
    .map((place, n) => place + (n % 2 ? top : left))"""
"""Where the last pin of the opening is, and its right handle [pixels]."""


def move_and_turn_a_pin(page: Page) -> None:
    """Drag the last pin of the opening, turn the curve there by a handle, and take the pin out."""
    x, y, *_ = page.window.run(PIN)
    for act, ended in (
        (lambda: page.window.drag((x, y), (x + 5, y - 3), (x + 10, y - 6)), r"pin opening \S+ at \S+"),
        (
            lambda: page.window.drag(tuple(page.window.run(PIN)[2:]), (x + 40, y - 30)),
            r"pin opening \S+ at \S+ slope \S+",
        ),
    ):
        count = len(page.steps)
        act()
        page.wait_for_steps(count + 2)
        unpin, pin = page.steps[-2:]
        assert re.fullmatch(r"unpin opening at \S+", unpin)
        assert re.fullmatch(ended, pin), pin
    page.edit(lambda: page.window.press(browser.DELETE), r"unpin opening at \S+")


def test_each_edit_by_pointer_and_keys(page):
    window = page.window

    def type_over(text: str) -> None:
        window.press(browser.ENTER)
        window.press(*text, browser.ENTER)

    page.choose(11)
    x, y = page.middle('.border[data-before="10"]')
    page.edit(lambda: window.drag((x, y), (x + 6, y), (x + 12, y)), r"phone 11 ends 1\.\d+")
    window.press(browser.TAB)
    assert page.of("studio.store.selected.index") == 11
    page.edit(lambda: window.press_together(browser.SHIFT, browser.RIGHT), r"phone 12 ends 1\.\d+")
    page.edit(lambda: type_over("t"), "phone 12 is t")
    page.edit(lambda: window.press("s"), r"split phone 12 at 1\.\d+")
    page.edit(lambda: window.press("m"), "remove phone 14")
    page.edit(lambda: window.press(browser.DELETE), "remove phone 13")
    page.choose(12)
    window.press(browser.UP)
    number = page.of("studio.store.selected.index") + 1
    assert page.of("studio.store.selected.kind") == "word"
    page.edit(lambda: type_over("the"), f"word {number} is the")
    page.edit(lambda: window.press("f"), r"hold from \S+ to \S+")
    page.edit(lambda: window.press("g"), r"lock from \S+ to \S+")
    page.edit(lambda: window.click("#unlock"), r"unlock from \S+ to \S+")
    page.edit(lambda: window.click("#insert"), r"insert ah from \S+ to \S+")
    page.edit(lambda: window.click("#gain-apply"), r"gain \S+ from \S+ to \S+")
    count, span = len(page.steps), page.of("studio.store.span")
    window.click("#mood-set")  # of the selection, after which the one before is back
    page.wait_for_steps(count + 2)
    moods = [re.fullmatch(r"mood (\S+) at (\S+)", step) for step in page.steps[-2:]]
    assert [mood[1] for mood in moods if mood] == ["happy:0.7", "neutral"]
    assert [float(mood[2]) for mood in moods if mood] == pytest.approx([span["start_s"], span["end_s"]], abs=1e-3)
    window.press(browser.ESCAPE, "d")
    x, y = page.middle('.curve[data-channel="opening"]')
    way = [(x + 10 * step, y - 2 * step) for step in range(1, 6)]
    page.edit(lambda: window.drag((x, y), *way), r"draw opening (\S+ ){3,}from \S+ to \S+")
    page.edit(lambda: window.drag((x - 90, y)), r"pin opening \S+ at \S+")
    window.press("d")
    move_and_turn_a_pin(page)
    window.click("#tab-delivery")
    page.edit(lambda: window.click("#set-stepped"), "set stepped true")
    made = page.steps
    for count in reversed(range(len(made))):
        window.press_together(browser.CONTROL, "z")
        page.wait_for_steps(count)
    for count in range(len(made)):
        window.press_together(browser.CONTROL, browser.SHIFT, "z")
        page.wait_for_steps(count + 1)
    assert page.steps == made
    assert [each for each in window.problems() if each.startswith("SEVERE") and "favicon" not in each] == []


def test_sound_and_face_are_in_step(page):
    wait_until(lambda: page.of("studio.weights.exact"), LIMIT_S)
    page.window.press(browser.ESCAPE, browser.ESCAPE)
    page.window.run(
        """const { head } = studio.stage, posed = head.pose.bind(head);
        window.offsets = [];
        head.pose = (weights, time_s) => {
          if (studio.store.playing) window.offsets.push(studio.player.audio.currentTime - time_s);
          posed(weights, time_s);
        };"""
    )
    page.window.run("studio.store.set({ looping: true, span: { start_s: 0.2, end_s: 2 } })")  # it never ends by itself
    for speed in (0.5, 1):  # after a click the keys are those of the page
        page.window.click("#half")
        assert page.of("studio.store.speed") == speed
    page.window.press(browser.SPACE)
    wait_until(lambda: page.of("window.offsets.length") > 5, LIMIT_S)
    page.window.press(browser.SPACE)
    assert page.of("studio.player.audio.paused")
    page.window.run("studio.store.set({ looping: false, span: null })")
    assert max(map(abs, page.of("window.offsets"))) <= FRAME_S
    page.window.run("document.getElementById('half').focus()")
    for speed in (0.5, 1):  # as one comes there by Tab: it is pressed
        page.window.press(browser.SPACE)
        assert page.of("[studio.store.speed, studio.store.playing]") == [speed, False]


def test_what_was_refused_is_told_until_something_succeeds(page):
    page.window.run("studio.store.set({ selected: null })")
    page.window.press("s")
    wait_until(lambda: "phone first" in page.window.text("#message"), LIMIT_S)
    page.window.press("a")
    wait_until(lambda: page.of("studio.store.recordings[0].mark") == "approved", LIMIT_S)
    assert page.window.text("#message") == ""
    page.window.press("a")
    wait_until(lambda: page.of("studio.store.recordings[0].mark") == "none", LIMIT_S)
    page.window.run(  # what the page reads while a recording is analysed comes later, and is not told
        """const { fetch } = window;
        window.fetch = async () => { window.fetch = fetch; return new Response("{}", { status: 503 }); };
        studio.store.set({ weights: null }); studio.weights.change(null);"""
    )
    page.ready()
    assert page.window.text("#message") == ""


def test_an_edit_waits_for_a_border_that_is_on_its_way(page):
    """It neither takes the place of the border's last place nor is lost; and the face stays known everywhere."""
    wait_until(lambda: page.of("studio.weights.exact"), LIMIT_S)
    before, ends_s = page.steps, page.of("studio.store.recording.phones[4].end_s")
    page.window.run(
        """const tier = studio.timeline.phones, ends_s = arguments[0];
        tier.drag(4, ends_s - 0.01);
        setTimeout(() => {
          tier.drag(4, ends_s - 0.02);
          tier.drop();
          studio.edit(["pin opening 0.02 at 4.5"]);
        }, 5);""",
        ends_s,
    )
    page.wait_for_steps(len(before) + 2)
    assert page.steps[-2:] == [f"phone 5 ends {ends_s - 0.02:.3f}", "pin opening 0.02 at 4.5"]
    assert page.of("studio.store.weights.values.every(Number.isFinite)")
    page.window.press_together(browser.CONTROL, "z")
    page.window.press_together(browser.CONTROL, "z")
    page.wait_for_steps(len(before))


def test_a_dropped_line_is_read_corrected_and_exported(tmp_path):
    said = WELCOME.with_suffix(".txt").read_text(encoding="utf-8")
    with shown(tmp_path) as page:
        window = page.window
        window.run(
            """studio.server.bytes(`lines/${studio.store.recordingId}/sound.wav`).then((sound) => studio.add(
              [new File([sound], "second.wav"), new File([arguments[0]], "second.txt")]));""",
            said,
        )
        wait_until(lambda: window.text("#title").endswith("second"), LIMIT_S)
        page.ready()
        assert page.of("studio.store.recording.words[1].label") == "speak"
        window.click('.words [data-index="1"]')
        window.run("document.getElementById('word-phones').value = 's p iy k s'")
        window.click("#word-keep")
        wait_until(lambda: "s p iy k s" in window.text("#offers"), LIMIT_S)
        page.edit(lambda: window.click("#word-change"), "word 2 is speak said s p iy k s")
        window.press(browser.ESCAPE, browser.ESCAPE, "a")
        wait_until(lambda: page.of("studio.store.recordings.at(-1).mark") == "approved", LIMIT_S)
        window.run("document.getElementById('transcript').value += ' now'")
        page.edit(lambda: window.click("#align"), r"say please .* now from \S+ to \S+ with speak s p iy k s")
        window.click("#export")
        window.click("#export-approved")
        wait_until(lambda: "Written" in window.text("dialog"), LIMIT_S)
        wait_until(lambda: page.of("studio.store.recordings.at(-1).exported") == "yes", LIMIT_S)


def test_the_weights_of_the_page_are_those_of_the_exported_file(page):
    page.window.run("window.touching = setInterval(() => dispatchEvent(new PointerEvent('pointermove')), 100)")
    page.choose(9)
    page.edit(lambda: page.window.press(browser.ENTER, *"aa", browser.ENTER), "phone 9 is aa")
    page.edit(lambda: page.window.press("f"), r"hold from \S+ to \S+")
    wait_until(lambda: page.of("studio.weights.settling.wanted"), LIMIT_S)
    page.window.run_until_done("setTimeout(arguments[0], 4000)")
    assert not page.of("studio.weights.exact")  # what takes long waits while somebody works
    page.window.run("clearInterval(window.touching)")
    wait_until(lambda: page.of("studio.weights.exact"), LIMIT_S)
    names, frames = page.of("[studio.store.weights.names, studio.store.weights.frames]")
    values = np.array(page.of("[...studio.store.weights.values]")).reshape(frames, len(names))
    page.window.run_until_done(
        """const done = arguments[0], { server, store } = studio;
        server.post(`lines/${store.recordingId}/export`, { preset: "web" }).then(() => done());"""
    )
    read, _ = read_motion(page.project / "exports" / "welcome.glb")
    shared = [name for name in read.names if name in names]
    assert len(shared) > 20
    assert "jawOpen" in shared
    for name in shared:
        assert values[:, names.index(name)] == pytest.approx(read[name], abs=1e-5), name


def test_versions_are_kept_compared_and_gone_back_to(page):
    window = page.window
    page.choose(9)
    page.edit(lambda: window.press(browser.ENTER, *"aa", browser.ENTER), "phone 9 is aa")
    window.click("#tab-history")
    window.click("#compare-keep")
    wait_until(lambda: page.of("Boolean(studio.store.other?.weights)"), LIMIT_S)
    kept = page.of("studio.store.other.motion.values.join()")
    page.choose(12)
    page.edit(lambda: window.press(browser.ENTER, *"uw", browser.ENTER), "phone 12 is uw")
    page.reload()
    window.click("#tab-history")
    window.click("#version-1")
    wait_until(lambda: page.of("Boolean(studio.store.other?.weights)"), LIMIT_S)
    assert page.of("studio.store.other.motion.values.join()") == kept
    assert page.of("studio.store.motion.values.join()") != kept
    window.run("studio.player.seek(1.2)")
    window.click("#compare-over")
    wait_until(lambda: page.of(GHOST_PIXELS) > 1000, LIMIT_S)
    browser.check_screens(window, "versions", SCREENS, "studio.showPlace('panel')")
    window.click("#version-1-back")
    page.wait_for_steps(1)
    assert page.steps == ["phone 9 is aa"]
    wait_until(lambda: page.of("studio.store.recording.versions.length") == 2, LIMIT_S)
    window.click("#version-2-forget")
    wait_until(lambda: page.of("studio.store.recording.versions.length") == 1, LIMIT_S)


def test_a_line_that_is_opened_while_the_timeline_is_hidden_is_shown_later(page):
    page.window.run("document.getElementById('timeline').style.display = 'none'")
    wait_until(lambda: page.of("studio.timeline.width") == 0, LIMIT_S)
    page.window.run("const id = studio.store.recordingId; studio.store.set({ recordingId: '' }); studio.open(id)")
    page.ready()
    page.window.run("studio.timeline.zoom(2); document.getElementById('timeline').style.display = ''")
    wait_until(lambda: page.of("studio.timeline.width") > 0, LIMIT_S)
    wait_until(lambda: page.of("document.querySelectorAll('.phones .phone').length") > 10, LIMIT_S)
    assert page.of("studio.timeline.least_px_s <= studio.timeline.px_s && studio.timeline.px_s < 1000")


def test_what_another_window_did_is_shown(page):
    """What was not made can be made then; words that were typed stay in their field; a mark is refused, too."""
    before = page.steps

    def elsewhere(what: str, content: str) -> None:
        page.window.run_until_done(
            f"""const done = arguments[0], {{ server, store: {{ recording, recordingId }} }} = studio;
            server.post(`lines/${{recordingId}}/{what}`, {{ revision: recording.revision, {content} }})
              .then(() => done());"""
        )

    elsewhere("edits", "steps: ['set intensity 1.1']")
    page.window.click("#tab-edit")
    page.window.click("#mood-set")
    wait_until(lambda: "another window" in page.window.text("#message"), LIMIT_S)
    page.ready()
    assert page.steps == [*before, "set intensity 1.1"]
    page.window.click("#make-again")
    wait_until(lambda: len(page.steps) == len(before) + 2, LIMIT_S)
    page.ready()
    elsewhere("mark", "mark: 'redo'")
    page.window.run("studio.leave(); studio.leave(); document.getElementById('transcript').value += ' now'")
    page.window.click("#align")
    wait_until(lambda: "another window" in page.window.text("#message"), LIMIT_S)
    page.ready()
    assert page.of("document.getElementById('transcript').value").endswith(" now")
    assert len(page.steps) == len(before) + 2
    elsewhere("undo", "count: 2")
    page.window.click("#approve")
    wait_until(lambda: "another window" in page.window.text("#message"), LIMIT_S)
    page.ready()
    assert (page.steps, page.of("studio.store.recordings[0].mark")) == (before, "redo")


def test_damaged_edits_are_restored(page):
    page.edit(lambda: page.window.click("#mood-set"), r"mood \S+ at \S+")
    steps, (file,) = page.steps, page.project.glob("edits/*.edits.json")
    file.write_text("{", encoding="utf-8")
    page.window.run("studio.open(studio.store.recordingId, true)")
    wait_until(lambda: page.of("studio.store.recording?.status") == "failed", LIMIT_S)
    assert "copies" in page.window.text("#cover")
    page.window.click("#restore")
    page.ready()
    assert page.steps == steps
    assert [each.read_text(encoding="utf-8") for each in page.project.glob("edits/*.damaged-*")] == ["{"]


def test_ten_thousand_lines_scroll(page):
    page.window.run(
        """const [line] = studio.store.recordings;
        const made = (_, n) => ({ ...line, id: n + 1, name: `line ${n}`, doubt: (n * 7919 % 997) / 997 });
        studio.store.set({ recordings: Array.from({ length: 10000 }, made) });"""
    )
    wait_until(lambda: "10000" in page.window.text(".count"), LIMIT_S)
    page.window.run("document.querySelector('.view').scrollTop = 150000")
    wait_until(lambda: "line 5000" in page.window.text(".view"), LIMIT_S)
    assert page.of("document.querySelectorAll('.line').length") < 100
    page.window.run("const order = document.querySelector('#queue select'); order.value = 'doubt'; order.onchange()")
    shown = page.of("studio.queue.recordings.slice(0, 50).map(({ doubt }) => doubt)")
    assert shown == sorted(shown, reverse=True)


def test_every_screen(page):
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
        ("failed", f"{CLOSED}; studio.store.set({{ recording: {FAILED} }})"),
        ("empty", "studio.store.set({ recordings: [], recording: null, recordingId: '' })"),
    )  # fmt: skip
    for width, height, scheme in SCREENS:
        page.reload()
        window.show_as(width, height, scheme, mobile=width < 600)
        for name, act in states:
            window.run(act)
            window.run_until_done("setTimeout(arguments[0], 100)")
            browser.check_screen(window, name, width, scheme)
    window.show_as(1200, 900)


def test_the_real_video_beside_and_comparisons(tmp_path, filmed_face_file):
    sound = Path(shutil.copy(WELCOME, tmp_path))
    pictures = (np.full((64, 96, 3), 40 + number % 200, np.uint8) for number in range(100))
    write_film(tmp_path / "in step.mp4", pictures, sound)
    shifted(tmp_path / "in step.mp4", sound.with_suffix(".mp4"), sound_s=0.2)
    other = tmp_path / find_shipped().name  # another file, of the same name
    model = load_model()
    save_model(replace(model, about={**model.about, "seed": "another"}), other)
    with shown(tmp_path, sound, "--against", other, "--face", filmed_face_file) as page:
        window = page.window
        window.press("x")
        wait_until(lambda: page.of("document.querySelector('.recorded').readyState") >= 2, LIMIT_S)
        window.run("studio.player.seek(1.23)")
        wait_until(lambda: page.of("!document.querySelector('.recorded').seeking"), LIMIT_S)
        assert abs(page.of("document.querySelector('.recorded').currentTime") - 1.43) <= 1 / 25
        window.click("#tab-history")
        window.click("#compare-model")
        wait_until(lambda: page.of("Boolean(studio.store.other?.weights)"), LIMIT_S)
        assert page.of("studio.store.other.motion.names") == ["opening", "width", "outer"]
        more = page.of(NOT_SHOWN)
        window.run("performance.clearResourceTimings(); studio.showCurves(['width', arguments[0]])", more)
        wait_until(lambda: page.of("studio.store.other.motion.names") == ["width", more], LIMIT_S)
        assert [asked for asked in window.run(ASKED) if asked.endswith("other")] == [f"motion {more} other"]
        assert page.of("studio.store.other.motion.frames") == page.of("studio.store.motion.frames")
        window.click("#compare-sides")
        assert page.of("studio.stage.head.pair.length") == 2
        for width, height, scheme in SCREENS:
            window.show_as(width, height, scheme, mobile=width < 600)
            window.run("studio.showPlace('panel')")
            window.run_until_done("setTimeout(arguments[0], 100)")
            browser.check_screen(window, "compared", width, scheme)
        window.show_as(1440, 900, "light", mobile=False)
        window.run("studio.store.set({ span: { start_s: 0.5, end_s: 0.8 } })")
        window.click("#film")
        wait_until(lambda: page.of("document.querySelector('#stage .film').readyState") >= 2, LIMIT_S)
        window.run("studio.player.seek(0.7)")  # the video is that of the selection, from 0.5 s on
        wait_until(lambda: abs(page.of("document.querySelector('#stage .film').currentTime") - 0.2) < 1 / 25, LIMIT_S)
        window.run("studio.store.set({ span: { start_s: 1, end_s: 1.2 } })")
        wait_until(lambda: page.of("document.querySelector('#stage .film').hidden"), LIMIT_S)
        window.run("studio.store.set({ face: 'toy', mesh: '' })")  # its video is asked for, of another model's channels
        wait_until(lambda: "the face: its motion" in window.text("#stage .note"), LIMIT_S)
        browser.check_screen(window, "filmed", 1440, "light")
        problems = [each for each in window.problems() if each.startswith("SEVERE") and "favicon" not in each]
        assert [each for each in problems if "/video " not in each] == []  # that one was refused
