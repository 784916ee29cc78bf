"""Live frames in a real browser: the page of the window, and TalkingHead's own module."""

import csv
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from io import TextIOWrapper
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

import programs
from children import LIPMOTION, PIPE, child, wait_until
from lipmotion import Stream
from lipmotion.live.consumers import LiveSound, open_consumer
from pipeline.made import read_welcome
from study.browser import NEEDED, browser, check_screens

pytest.importorskip("websockets", reason="the extra 'live' is not installed")

from lipmotion_studio.live.talking_head import TalkingHead

pytestmark = [pytest.mark.long, NEEDED]
SCREENS = ((1200, 800, "light"), (900, 700, "dark"), (320, 560, "light"))
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--autoplay-policy=no-user-gesture-required")
LIMIT_S = 240.0
SPOKEN_S = 3
CONNECTED = "return Boolean(globalThis.live?.state.isConnected)"
CLOCK = (programs.FOLDER / "live_clock.js").read_text("utf-8")
SHOWN = CLOCK + "return weightsAt(arguments[0]);"


def address_in(text):
    """Return the address that a line names."""
    return next(word for word in text.split() if "://" in word)


def is_connected(window):
    """Return whether the page has its head and a connection; where a processor draws, the first picture takes long."""
    try:
        return window.run(CONNECTED)
    except AssertionError as error:
        if "script timeout" not in str(error):
            raise
        return False


def test_the_head_speaks_in_step_with_its_sound(tmp_path):
    command = [*LIPMOTION, "live", "-i", "-", "--rate", 16000, "--to", "window:0", "--to", tmp_path / "a.csv"]
    sound = (read_welcome().samples[: 16000 * SPOKEN_S] * 32767).astype("<i2").tobytes()
    (tmp_path / "home").mkdir()
    with browser(tmp_path / "home", *WEBGL) as window:
        with child(command, stdin=PIPE, stderr=PIPE) as process:
            assert isinstance(process.stderr, TextIOWrapper)
            assert isinstance(process.stdin, TextIOWrapper)
            window.open(address_in(process.stderr.readline()))
            wait_until(lambda: is_connected(window), LIMIT_S)
            check_screens(window, "live", SCREENS)
            window.click("#sound")
            wait_until(lambda: window.run("return live.playback.isHeard && live.playback.context.currentTime"), LIMIT_S)
            window.run(CLOCK + "hold();")
            process.stdin.buffer.write(sound)
            process.stdin.buffer.flush()
            wait_until(lambda: window.run("return heard.length") == 50 * SPOKEN_S, LIMIT_S)
            process.stdin.close()
            assert process.wait() == 0
        wait_until(lambda: "No connection" in window.text("#state"), LIMIT_S)
        rows = list(csv.DictReader((tmp_path / "a.csv").read_text("utf-8").splitlines()))
        times, sent = (np.array([float(row[name]) for row in rows]) for name in ("time_s", "jawOpen"))
        # at frames, and between them; the last ones, sent as the stream ends, a slow browser may miss
        steps = np.arange(0, times[-1] - 0.3, 0.0125)
        shown, heard = window.run(SHOWN, steps.tolist()), window.run("return heard")
        rested = window.run(SHOWN, [times[-1] + 1])
        assert window.run("return live.drawing") is False
        gone = ("WebSocket", "ERR_CONNECTION_REFUSED")  # the server has ended: a browser may ask for the icon late
        problems = [each for each in window.problems() if "SEVERE" in each and not any(word in each for word in gone)]
    assert shown == pytest.approx(np.interp(steps, times, sent), abs=1e-3)
    assert max(shown) > 0.02
    assert rested == [0]  # nothing comes
    assert np.diff(heard) == pytest.approx(320, abs=1e-3)  # no seams
    assert heard == pytest.approx(np.rint(heard), abs=1e-3)
    assert problems == []


@contextmanager
def open_page(folder, package, capsys):
    """Give a window with a package's page, which is told the server that was opened; a folder's files lie beside it."""
    place = address_in(capsys.readouterr().err).removeprefix("ws://").rstrip("/")
    modules, name = programs.node_package(package), package.rpartition("/")[2] + ".html"
    if modules is None:
        pytest.skip(f"no {package}: npm install {package} three, LIPMOTION_NODE_MODULES")
    beside = [Path(modules).resolve().parents[1] / each for each in (package.partition("/")[0], "three")]
    for each in (programs.FOLDER / name, *beside):
        (folder / each.name).symlink_to(each)
    served = partial(SimpleHTTPRequestHandler, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), served) as server, browser(folder, *WEBGL) as window:
        Thread(target=server.serve_forever, daemon=True).start()
        window.open(f"http://127.0.0.1:{server.server_port}/{name}?{place}")
        yield window
        problems = [each for each in window.problems() if "SEVERE" in each and "favicon" not in each]
        server.shutdown()
    assert problems == []


def test_talking_head_takes_sound_and_blendshapes(tmp_path, capsys):
    audio = read_welcome()
    stream, about, frames = Stream(audio.rate_hz), LiveSound(audio.rate_hz), []
    with (
        open_consumer("talkinghead:0", print, about) as head,
        open_page(tmp_path, "@met4citizen/talkinghead", capsys) as window,
    ):
        assert isinstance(head, TalkingHead)
        wait_until(lambda: window.run("return globalThis.called?.includes('streamStart')"), LIMIT_S)
        for first in range(0, 3 * audio.rate_hz, 320):
            head.hear(audio.samples[first : first + 320])
            for frame in stream.push(audio.samples[first : first + 320]):
                frames.append(frame)
                head(frame)
        wait_until(lambda: window.run("return head.streamAudioStartTime"), LIMIT_S)
        head.interrupt()
        wait_until(lambda: window.run("return called.at(-1) === 'streamInterrupt'"), LIMIT_S)
        queued = window.run("return queued")
        assert window.run("return head.isSpeaking") is False
    first = len(frames) - len(queued)
    assert len(queued) > 100
    assert [time for time, _ in queued] == pytest.approx([20.0 * number for number in range(len(queued))], abs=0.2)
    assert [jaw for _, jaw in queued] == pytest.approx([frame["jawOpen"] for frame in frames[first:]], abs=1e-3)
