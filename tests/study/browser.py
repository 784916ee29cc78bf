"""A real browser without a window: Chromium, driven over the WebDriver protocol (W3C), without a client library."""

import base64
import http.client
import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from children import NOWHERE, PIPE, child, environment, wait_until

ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, PROGRAMS)), None)
DRIVER = shutil.which("chromedriver")
MISSING = "no Chromium with its driver: apt install chromium chromium-driver"
NEEDED = pytest.mark.skipif(not (BROWSER and DRIVER), reason=MISSING)  # for tests of pages
SPACE, ENTER, LEFT, RIGHT = " ", "\ue007", "\ue012", "\ue014"
ESCAPE, TAB, SHIFT, CONTROL, UP, DELETE = "\ue00c", "\ue004", "\ue008", "\ue009", "\ue013", "\ue017"
"""Keys, as WebDriver names them."""
WINDOW_S = 3600.0  # a window may stay open that long: all tests of a page share one


class Browser:
    """A window of a browser."""

    def __init__(self, port: int, session: str) -> None:
        self._port, self._session = port, session

    def command(self, method: str, path: str, content: Any = None) -> Any:
        """Return the value of a command of WebDriver. Raises AssertionError: it failed."""
        return webdriver(self._port, method, f"/session/{self._session}{path}", content)

    def open(self, address: str) -> None:
        """Open a page."""
        self.command("POST", "/url", {"url": address})

    def run(self, script: str, *arguments: Any) -> Any:
        return self.command("POST", "/execute/sync", {"script": script, "args": arguments})

    def run_until_done(self, script: str, *arguments: Any) -> Any:
        """Return what a script gives to its last argument, a function."""
        return self.command("POST", "/execute/async", {"script": script, "args": arguments})

    def press(self, *keys: str) -> None:
        """Press keys one after another, where the focus is."""
        actions = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self.command("POST", "/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": actions}]})

    def press_together(self, *keys: str) -> None:
        """Press keys while the ones before are held."""
        downs = [{"type": "keyDown", "value": key} for key in keys]
        ups = [{"type": "keyUp", "value": key} for key in reversed(keys)]
        self.command("POST", "/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": downs + ups}]})

    def drag(self, start: tuple[float, float], *way: tuple[float, float]) -> None:
        """Take hold with the mouse where the way starts, and let go at its end [pixels]."""

        def to(place: tuple[float, float], ms: int) -> dict[str, Any]:
            return {"type": "pointerMove", "duration": ms, "x": round(place[0]), "y": round(place[1])}

        acts = [to(start, 0), {"type": "pointerDown", "button": 0}]
        acts += [*(to(place, 50) for place in way), {"type": "pointerUp", "button": 0}]
        self.command("POST", "/actions", {"actions": [{"type": "pointer", "id": "mouse", "actions": acts}]})

    def click(self, selector: str) -> None:
        """Click an element, as a person does: it must be seen. One that is drawn anew just then is looked for again."""

        def clicked() -> bool:
            found = self.command("POST", "/element", {"using": "css selector", "value": selector})
            try:
                self.command("POST", f"/element/{found[ELEMENT]}/click", {})
            except AssertionError as error:
                if "stale element" not in str(error):
                    raise
                return False
            return True

        wait_until(clicked, 60)

    def text(self, selector: str) -> str:
        """Return the text of an element, as it is seen; empty: it is hidden or not there."""
        return str(self.run("return document.querySelector(arguments[0])?.innerText ?? ''", selector))

    def cdp(self, name: str, **parameters: Any) -> Any:
        """Return the result of a command of Chromium's own protocol."""
        return self.command("POST", "/goog/cdp/execute", {"cmd": name, "params": parameters})

    def show_as(self, width: int, height: int, scheme: str = "light", *, mobile: bool = False) -> None:
        """Be a screen of a size, light or dark."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}
        self.cdp("Emulation.setDeviceMetricsOverride", **size)
        scheme_feature = [{"name": "prefers-color-scheme", "value": scheme}]
        self.cdp("Emulation.setEmulatedMedia", features=scheme_feature)

    def picture(self, path: Path) -> None:
        """Write what is seen of the whole page as a PNG file."""
        data = self.cdp("Page.captureScreenshot", captureBeyondViewport=True)["data"]
        path.write_bytes(base64.b64decode(data))

    def problems(self) -> list[str]:
        """Return what the console has said since the last call that is no information."""
        return [
            f"{entry['level']}: {entry['message']}" for entry in self.command("POST", "/se/log", {"type": "browser"})
        ]


def webdriver(port: int, method: str, path: str, content: Any = None) -> Any:
    """Return the value of the reply to a command. Raises AssertionError: it failed."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        connection.request(method, path, None if content is None else json.dumps(content))
        reply = json.loads(connection.getresponse().read())["value"]
    finally:
        connection.close()
    assert not (isinstance(reply, dict) and "error" in reply), reply
    return reply


@contextmanager
def browser(folder: Path, *more_switches: str) -> Iterator[Browser]:
    """Give a browser with a profile of its own in a folder."""
    variables = environment(HOME=str(folder))
    with child([DRIVER, "--port=0"], variables=variables, stdout=PIPE, stderr=NOWHERE, limit_s=WINDOW_S) as driver:
        line = ""
        while "on port" not in line or "successfully" not in line:
            line = driver.stdout.readline() if driver.stdout else ""
            assert line, "the driver of the browser ended"
        port = int(line.rstrip().rstrip(".").split()[-1])
        wait_until(lambda: webdriver(port, "GET", "/status")["ready"], 60)
        switches = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--mute-audio", "--disable-gpu"]
        switches += [f"--user-data-dir={folder / 'profile'}", "--window-size=1200,900", *more_switches]
        options = {"binary": BROWSER, "args": switches}
        wanted = {"browserName": "chrome", "goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "WARNING"}}
        session = webdriver(port, "POST", "/session", {"capabilities": {"alwaysMatch": wanted}})["sessionId"]
        try:
            yield Browser(port, session)
        finally:
            webdriver(port, "DELETE", f"/session/{session}")


def check_screen(window: Browser, name: str, width: int, scheme: str) -> None:
    """Check a page as it is shown: no scrolling to the side, and nothing that axe-core finds.

    name, width, scheme : for messages, and for the name of its picture, which is kept in the folder of the environment
                          variable ``LIPMOTION_SCREENS``, if there is one
    """
    axe, folder = axe_script(), os.environ.get("LIPMOTION_SCREENS")
    if folder:
        window.picture(Path(folder) / f"{name}-{width}-{scheme}.png")
    assert window.run("return document.documentElement.scrollWidth") <= width, (name, width)
    if axe:
        window.run(axe)
        found = window.run_until_done("axe.run().then(arguments[0])")["violations"]
        assert [(each["id"], each["nodes"][0]["html"]) for each in found] == [], (name, width, scheme)


def check_screens(window: Browser, name: str, screens: Iterable[tuple[int, int, str]], script: str = "") -> None:
    """Check a page on screens of some widths, heights and colours; a script runs on each of them first."""
    for width, height, scheme in screens:
        window.show_as(width, height, scheme, mobile=width < 600)
        if script:
            window.run(script)
            window.run_until_done("setTimeout(arguments[0], 100)")
        check_screen(window, name, width, scheme)
    window.show_as(1200, 900)


@cache
def axe_script() -> str | None:
    """Return the script of axe-core, which finds what keeps people out of a page; None: it is not installed."""
    found = find_spec("axe_core_python")
    places = list(Path(found.origin or "").parent.rglob("axe.min.js")) if found else []
    return places[0].read_text(encoding="utf-8") if places else None
