"""Live frames in a real browser: the page of the window, and TalkingHead's own module."""

import csv
import re
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

import programs
from children import LIPMOTION, PIPE, child, wait_until
from lipmotion import Stream
from lipmotion.live.consumers import LiveSound, open_consumer
from lipmotion.speech.sound.audio_files import read_audio
from study.browser import check_screens
from study.firefox import BOTH

pytest.importorskip("websockets", reason="the extra 'live' is not installed")

pytestmark = pytest.mark.long
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"
SCREENS = ((1200, 800, "light"), (900, 700, "dark"), (320, 560, "light"))
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--autoplay-policy=no-user-gesture-required")
LIMIT_S = 240.0
CONNECTED = "return Boolean(globalThis.live?.state.isConnected)"
WATCH = """const { playback, head } = live, { schedule } = playback, pose = head.pose.bind(head);
const mesh = head.meshes.find((each) => "jawOpen" in each.morphTargetDictionary);
const place = mesh.morphTargetDictionary.jawOpen;
const clock = Object.getOwnPropertyDescriptor(Object.getPrototypeOf(playback), "time_s").get;
let read_s = 0; // the time that was read last
Object.defineProperty(playback, "time_s", { get() { return (read_s = clock.call(this)); } });
globalThis.shown = [];
globalThis.heard = [];
head.pose = (...given) => {
  pose(...given);
  shown.push([read_s, mesh.morphTargetInfluences[place]]);
};
playback.schedule = (begin_s, samples) => {
  heard.push((begin_s + playback.anchor_s - playback.shift_s) * playback.rate_hz);
  schedule.call(playback, begin_s, samples);
};"""
"""From now on it is noted when in the stream the jaw has which weight, and when which sound is to be played."""


def is_connected(window):
    """Return whether the page has its head and a connection; where a processor draws, the first picture takes long."""
    try:
        return window.run(CONNECTED)
    except AssertionError as error:
        if "script timeout" not in str(error):
            raise
        return False


@pytest.mark.parametrize("opens", BOTH)
def test_the_head_speaks_in_step_with_its_sound(opens, tmp_path):
    command = [*LIPMOTION, "live", "-i", "-", "--rate", 16000, "--to", "window:0", "--to", tmp_path / "a.csv"]
    sound = (read_audio(WELCOME).samples * 32767).astype("<i2").tobytes()
    (tmp_path / "home").mkdir()
    with opens(tmp_path / "home", *WEBGL) as window:
        with child(command, stdin=PIPE, stderr=PIPE) as process:
            window.open(re.search(r"http://\S+", process.stderr.readline())[0])
            wait_until(lambda: is_connected(window), LIMIT_S)
            check_screens(window, "live", SCREENS)
            window.show_as(320, 240)  # processors draw here, and they are slow
            window.click("#sound")
            wait_until(lambda: window.run("return live.playback.isHeard"), LIMIT_S)
            window.run(WATCH)
            process.stdin.buffer.write(sound)
            process.stdin.close()
            assert process.wait() == 0
        wait_until(lambda: "No connection" in window.text("#state"), LIMIT_S)
        wait_until(lambda: window.run("return shown.length > 0 && !live.drawing"), LIMIT_S)
        shown, heard = np.array(window.run("return shown")), np.array(window.run("return heard"))
        problems = [each for each in window.problems() if "SEVERE" in each and "WebSocket" not in each]
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text("utf-8").splitlines()))
    times, sent = (np.array([float(row[name]) for row in rows]) for name in ("time_s", "jawOpen"))
    during = shown[(shown[:, 0] > 0) & (shown[:, 0] < times[-1])]
    assert len(during) > 2  # processors draw here
    assert np.median(np.abs(during[:, 1] - np.interp(during[:, 0], times, sent))) < 1e-3
    assert during[:, 1].max() > 0.02
    assert shown[-1, 1] == 0  # nothing comes: it rests
    assert len(heard) == len(sound) // 640
    assert heard == pytest.approx(np.rint(heard), abs=1e-3)  # pieces begin at whole samples: no seams
    assert problems == []


class Modules(SimpleHTTPRequestHandler):
    """Serves packages of npm, and the page that uses them."""

    def translate_path(self, path):
        page = path.partition("?")[0] == "/talking_head.html"
        return str(programs.FOLDER / "talking_head.html") if page else super().translate_path(path)

    def log_message(self, *_):
        pass


@pytest.mark.parametrize("opens", BOTH[:1])
def test_talking_head_takes_sound_and_blendshapes(opens, tmp_path, capsys):
    package = programs.node_package("@met4citizen/talkinghead")
    if package is None:
        pytest.skip("no TalkingHead: npm install @met4citizen/talkinghead, LIPMOTION_NODE_MODULES")
    audio = read_audio(WELCOME)
    stream, about = Stream(audio.rate_hz), LiveSound(audio.rate_hz)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Modules, directory=str(Path(package).parents[1])))
    Thread(target=server.serve_forever, daemon=True).start()
    with open_consumer("talkinghead:0", print, about) as head, opens(tmp_path, *WEBGL) as window:
        place = re.search(r"ws://(\S+)", capsys.readouterr().err)[1]
        window.open(f"http://127.0.0.1:{server.server_address[1]}/talking_head.html?{place}")
        wait_until(lambda: window.run("return globalThis.called?.includes('streamStart')"), LIMIT_S)
        frames = []
        for first in range(0, 3 * audio.rate_hz, 320):
            head.hear(audio.samples[first : first + 320])
            for frame in stream.push(audio.samples[first : first + 320]):
                frames.append(frame)
                head(frame)
        wait_until(lambda: window.run("return head.streamAudioStartTime && called.at(-1) === 'streamAudio'"), LIMIT_S)
        window.run_until_done("setTimeout(arguments[0], 1000)")
        queued = window.run(
            """return head.animQueue.filter(({ template }) => template.name === "blendshapes")
                .map(({ ts, vs }) => [ts[1] - head.streamAudioStartTime, vs.jawOpen[1]])"""
        )
        head.interrupt()
        wait_until(lambda: window.run("return called.at(-1) === 'streamInterrupt'"), LIMIT_S)
        assert window.run("return head.isSpeaking") is False
        problems = [each for each in window.problems() if "SEVERE" in each and "favicon" not in each]
    server.shutdown()
    first = len(frames) - len(queued)
    assert len(queued) > 100
    assert [time for time, _ in queued] == pytest.approx([20.0 * number for number in range(len(queued))], abs=0.2)
    assert [jaw for _, jaw in queued] == pytest.approx([frame["jawOpen"] for frame in frames[first:]], abs=1e-3)
    assert problems == []
