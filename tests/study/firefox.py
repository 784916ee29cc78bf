"""The other real browser: Firefox without a window, driven over its own protocol, Marionette, by the same commands.

A message is ``LENGTH:[0, number, name, parameters]``, a reply ``LENGTH:[1, number, error, result]``; names and
parameters are those of WebDriver, which Firefox itself answers only through a further program. Without any screen it
draws no WebGL, so it gets one that nobody sees.
"""

import base64
import json
import re
import shutil
import socket
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from children import NOWHERE, child, environment, wait_until
from study.browser import BROWSER, DRIVER, MISSING, WINDOW_S, Browser, browser

PROGRAM = next(filter(None, map(shutil.which, ("firefox-esr", "firefox"))), None)
SCREEN = shutil.which("Xvfb")
NO_FIREFOX = "no Firefox, or no screen for its WebGL: apt install firefox-esr xvfb"
START_S = 120.0
NAMES = {
    "/url": "WebDriver:Navigate",
    "/execute/sync": "WebDriver:ExecuteScript",
    "/execute/async": "WebDriver:ExecuteAsyncScript",
    "/actions": "WebDriver:PerformActions",
    "/element": "WebDriver:FindElement",
}
"""What WebDriver's addresses are called here."""
PREFERENCES = {
    "app.update.disabledForTesting": True, "browser.shell.checkDefaultBrowser": False,
    "browser.startup.homepage_override.mstone": "ignore", "browser.tabs.remote.unloadOnLowMemory": False,
    "datareporting.policy.dataSubmissionEnabled": False, "marionette.port": 0, "media.autoplay.blocking_policy": 0,
    "media.autoplay.default": 0, "media.cubeb.force_mock_context": True,
    "network.captive-portal-service.enabled": False, "network.connectivity-service.enabled": False,
    "toolkit.telemetry.reportingpolicy.firstRun": False, "webgl.force-enabled": True,
}  # fmt: skip
SCHEMES = {"dark": 0, "light": 1}
SHOW_AS = """const [width, height, scheme] = arguments, { style } = gBrowser.selectedBrowser;
Services.prefs.setIntPref("layout.css.prefers-color-scheme.content-override", scheme);
for (const [side, pixels] of [["width", width], ["height", height]]) {
  for (const name of [side, `min-${side}`, `max-${side}`]) style.setProperty(name, `${pixels}px`);
}"""
PROBLEMS = """const found = Services.console.getMessageArray().filter((each) => each instanceof Ci.nsIScriptError
  && each.category === "content javascript" && !(each.flags & Ci.nsIScriptError.warningFlag));
Services.console.reset();
return found.map((each) => `SEVERE: ${each.errorMessage} ${each.sourceName}:${each.lineNumber}`);"""


class Firefox(Browser):
    """A window of Firefox."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(0, "")
        self._connection, self._number = connection, 0
        self._read()  # it says what it is
        self.tell("WebDriver:NewSession", {"capabilities": {"alwaysMatch": {"acceptInsecureCerts": False}}})

    def command(self, method: str, path: str, content: Any = None) -> Any:
        clicked = re.fullmatch(r"/element/(.+)/click", path)
        if clicked:
            return self.tell("WebDriver:ElementClick", {"id": clicked[1]})
        assert method == "POST", (method, path)
        return self.tell(NAMES[path], content)

    def tell(self, name: str, parameters: Any) -> Any:
        """Return the value of a command of Marionette. Raises AssertionError: it failed."""
        self._number += 1
        message = json.dumps([0, self._number, name, parameters]).encode()
        self._connection.sendall(b"%d:%s" % (len(message), message))
        _, number, error, result = self._read()
        assert number == self._number, (number, self._number)
        assert error is None, error
        return result["value"] if isinstance(result, dict) and result.keys() == {"value"} else result

    def _read(self) -> Any:
        """Return the next message. Raises AssertionError: the browser ended."""
        length, letter = b"", b""
        while letter != b":":
            length += letter
            letter = self._connection.recv(1)
            assert letter, "the browser ended"
        content = b""
        while len(content) < int(length):
            part = self._connection.recv(int(length) - len(content))
            assert part, "the browser ended"
            content += part
        return json.loads(content)

    def _in_chrome(self, script: str, *arguments: Any) -> Any:
        """Return what a script returns that is run in the window around the page."""
        self.tell("Marionette:SetContext", {"value": "chrome"})
        try:
            return self.run(script, *arguments)
        finally:
            self.tell("Marionette:SetContext", {"value": "content"})

    def show_as(self, width: int, height: int, scheme: str = "light", *, mobile: bool = False) -> None:
        del mobile  # a finger is the same to pages as a mouse
        self._in_chrome(SHOW_AS, width, height, SCHEMES[scheme])
        wait_until(lambda: self.run("return innerWidth") == width, 30)

    def picture(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self.tell("WebDriver:TakeScreenshot", {"full": True})))

    def problems(self) -> list[str]:
        return list(self._in_chrome(PROBLEMS))


@contextmanager
def firefox(folder: Path, *switches: str) -> Iterator[Browser]:
    """Give a Firefox with a profile of its own in a folder; switches of Chromium mean nothing to it."""
    del switches
    profile = folder / "firefox"
    profile.mkdir()
    rows = (f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in PREFERENCES.items())
    (profile / "user.js").write_text("".join(rows), encoding="utf-8")
    command = [
        PROGRAM, "--headless", "--marionette", "--remote-allow-system-access", "--no-remote", "--profile", profile,
    ]  # fmt: skip
    size = {"MOZ_HEADLESS_WIDTH": "1200", "MOZ_HEADLESS_HEIGHT": "1000"}
    with ExitStack() as stack:
        screen = stack.enter_context(
            child([SCREEN, "-displayfd", 1, "-nolisten", "tcp"], stderr=NOWHERE, limit_s=WINDOW_S)
        )
        number = screen.stdout.readline().strip() if screen.stdout else ""
        assert number, "the screen ended"
        variables = environment(HOME=str(folder), DISPLAY=f":{number}", **size)
        stack.enter_context(child(command, variables=variables, stdout=NOWHERE, stderr=NOWHERE, limit_s=WINDOW_S))
        told = profile / "MarionetteActivePort"
        wait_until(lambda: told.exists() and told.read_text(encoding="utf-8").strip(), START_S)
        port = int(told.read_text(encoding="utf-8"))
        yield Firefox(stack.enter_context(socket.create_connection(("127.0.0.1", port), START_S)))


Opens = Callable[..., AbstractContextManager[Browser]]
HAS_CHROMIUM, HAS_FIREFOX = bool(BROWSER and DRIVER), bool(PROGRAM and SCREEN)
SECOND = (pytest.mark.second_browser,) if HAS_CHROMIUM else ()
BOTH = (
    pytest.param(browser, id="chromium", marks=pytest.mark.skipif(not HAS_CHROMIUM, reason=MISSING)),
    pytest.param(firefox, id="firefox", marks=(*SECOND, pytest.mark.skipif(not HAS_FIREFOX, reason=NO_FIREFOX))),
)
"""For tests of pages: what opens each browser. Where there is Chromium, Firefox waits for ``--both-browsers``."""
