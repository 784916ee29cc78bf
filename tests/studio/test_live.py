"""Live frames over WebSockets: servers that pages connect to, TalkingHead's calls, VTube Studio."""

import base64
import json
import re
import socket
import struct
import sys
from contextlib import ExitStack, contextmanager
from queue import Queue
from threading import Thread
from typing import Any

import numpy as np
import pytest

from children import wait_until
from lipmotion import LiveFrame, errors
from lipmotion.live.consumers import Listener, LiveSound, json_line, open_consumer
from lipmotion.live.face import WEIGHT_NAMES
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH

pytest.importorskip("websockets", reason="the extra 'live' is not installed")
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.sync.server import serve
from websockets.typing import Origin

from lipmotion_studio.live import servers, talking_head, vtube
from lipmotion_studio.live.window import LiveWindow

RATE_HZ = 16_000
FRAME = RATE_HZ // 50
UPGRADE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: " + 22 * "A" + "=="
)


def frame(number=0, **weights):
    everything = dict.fromkeys(WEIGHT_NAMES, 0.0) | {"viseme_sil": 0.0} | weights
    return LiveFrame(number * 0.02, number * 0.02 + 0.1, np.array([0.125, 0.5]), ("opening", "width"), everything)


@contextmanager
def opened(to, capsys):
    """Give a consumer that serves, and its address."""
    with open_consumer(f"{to}:0", print, LiveSound(RATE_HZ)) as consumer:
        yield consumer, next(word for word in capsys.readouterr().err.split() if "://" in word)


def port_of(address):
    return int(address.rpartition(":")[2].rstrip("/"))


def repeat_until_any(act, received):
    """Do something again and again until a queue has anything."""
    wait_until(lambda: (act(), not received.empty())[1], 60)


@contextmanager
def client_of(consumer, address):
    """Give a client that is connected, and has got a frame."""
    with connect(address, proxy=None) as client:
        received: Queue[str | bytes] = Queue()
        Thread(target=lambda: received.put(client.recv()), daemon=True).start()
        repeat_until_any(lambda: consumer(frame()), received)
        yield client


def gets(client, wanted):
    """Return whether a message comes, before the connection ends."""
    return any(message == wanted for message in client)


def test_each_client_gets_each_frame_and_may_go(capsys):
    with ExitStack() as stack:
        with opened("websocket", capsys) as (take, address):
            first, second = (stack.enter_context(client_of(take, address)) for _ in range(2))
            take(frame(7, jawOpen=0.25))
            assert gets(first, json_line(frame(7, jawOpen=0.25)))
            first.close()
            take(frame(8))
            assert gets(second, json_line(frame(8)))
            third = stack.enter_context(client_of(take, address))
            take(frame(9))
        for client in (second, third):  # what was sent is taken before the stream ends
            assert gets(client, json_line(frame(9)))
            assert not gets(client, "")


def test_a_client_that_hangs_holds_nobody_up(monkeypatch):
    """What it does not take is dropped, the oldest first; and the end does not wait for it."""
    monkeypatch.setattr(servers, "QUEUED", 5)
    monkeypatch.setattr(servers, "CLOSE_S", 0.05)
    with servers.open_server("websocket:0", 0) as server:
        port, received = port_of(server.address), Queue[bool]()
        with socket.create_connection(("127.0.0.1", port)) as hung, connect(f"ws://{server.address}") as good:
            hung.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n{UPGRADE}\r\n\r\n".encode())
            assert hung.recv(1)
            for _ in range(100):
                server.send(200_000 * "x")
            Thread(target=lambda: received.put(gets(good, "last")), daemon=True).start()
            repeat_until_any(lambda: server.send("last"), received)
            assert received.get()


def test_pages_of_other_sites_may_not_listen(capsys):
    with opened("websocket", capsys) as (_, address):
        for origin in ("https://example.org", "null", "http://localhost.example.org"):
            with pytest.raises(InvalidStatus, match="403"), connect(address, origin=Origin(origin), proxy=None):
                pass
        with connect(address, origin=Origin("http://localhost:8000"), proxy=None):
            pass


def test_an_address_that_is_taken_is_reported(capsys):
    with opened("websocket", capsys) as (_, address):
        port = port_of(address)
        with pytest.raises(errors.InputError, match=f"websocket:{port}"), open_consumer(f"websocket:{port}", print):
            pass


def test_a_missing_package_is_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "websockets.asyncio.server", None)
    with pytest.raises(errors.MissingDependencyError, match="live"), open_consumer("websocket", print):
        pass


def calls(client, count):
    """Return the next calls of TalkingHead's methods."""
    return [(message["call"], message["argument"]) for message in (json.loads(client.recv()) for _ in range(count))]


def test_talking_head_gets_sound_with_its_blendshapes(capsys):
    """Each speech begins at 0 on its own clock, after a pause, and for a page that has just come."""
    sound = np.arange(400 * FRAME).astype("<i2")

    def speak(head, numbers, **weights):
        for number in numbers:
            head.hear(sound[number * FRAME : (number + 1) * FRAME].tobytes())
            head(frame(number, **weights))

    with opened("talkinghead", capsys) as (head, address):
        assert isinstance(head, talking_head.TalkingHead)
        assert isinstance(head, Listener)
        with connect(address, proxy=None) as client:
            assert calls(client, 1) == [("streamStart", {"sampleRate": RATE_HZ, "lipsyncType": "blendshapes"})]
            speak(head, range(20), viseme_sil=1.0)
            speak(head, range(20, 24), jawOpen=0.5)
            spoken = [call for call in calls(client, 14) if call[0] == "streamAudio"][-13:]
            assert base64.b64decode(spoken[0][1]["audio"]) == sound[11 * FRAME : 12 * FRAME].tobytes()
            animations = [animation for _, argument in spoken for animation in argument["anims"]]
            assert [each["delay"] for each in animations] == [20.0 * number - 20 for number in range(13)]
            assert {each["name"] for each in animations} == {"blendshapes"}
            assert set(animations[-1]["vs"]) == set(ARKIT_MOUTH)
            assert animations[-1]["vs"]["jawOpen"] == [0.5]
            speak(head, range(24, 80), viseme_sil=1.0)
            speak(head, range(80, 84), jawOpen=0.25)
            after = calls(client, 49 + 1 + 10)
            assert [name for name, _ in after].index("streamInterrupt") == 49
            assert after[50][1]["anims"][0]["delay"] == -20
            head.interrupt()
            assert [name for name, _ in calls(client, 2)] == ["streamAudio", "streamInterrupt"]


@pytest.fixture
def token(monkeypatch, tmp_path):
    """Returns where the token of VTube Studio is kept, which is asked again soon."""
    monkeypatch.setattr(vtube, "AGAIN_S", 0.01)
    monkeypatch.setattr(vtube, "find_cache", lambda: tmp_path)
    return tmp_path / "vtube-studio.token"


@pytest.fixture
def studio():
    """Give a stand-in for VTube Studio: its address, and the requests that it gets."""
    requests: Queue[dict[str, Any]] = Queue()
    injections = []

    def reply(request):
        assert (request["apiName"], request["apiVersion"]) == ("VTubeStudioPublicAPI", "1.0")
        data, kind = request["data"], request["messageType"]
        if kind == "AuthenticationTokenRequest":
            assert all(3 <= len(data[name]) <= 32 for name in ("pluginName", "pluginDeveloper"))
            return {"authenticationToken": "a-token"}
        if kind == "AuthenticationRequest":
            return {"authenticated": data["authenticationToken"] == "a-token", "reason": ""}
        if kind == "InputParameterListRequest":
            defaults = [{"name": name} for name in ("MouthOpen", "MouthSmile", "FaceAngleX")]
            return {"modelLoaded": True, "defaultParameters": defaults, "customParameters": [{"name": "JawOpen"}]}
        if kind == "ParameterCreationRequest":
            assert re.fullmatch("[A-Za-z0-9]{4,32}", data["parameterName"])
            assert data["min"] < data["max"]
            return {"parameterName": data["parameterName"]} if data["parameterName"] != "MouthShrug" else None
        assert kind == "InjectParameterDataRequest"
        assert (data["mode"], data["faceFound"]) == ("set", True)
        assert all(set(each) == {"id", "value"} for each in data["parameterValues"])
        return {}

    def handle(connection):
        for message in connection:
            request = json.loads(message)
            requests.put(request)
            data = reply(request)
            about = {**request, "messageType": request["messageType"].replace("Request", "Response"), "timestamp": 1}
            refused = {"messageType": "APIError", "data": {"errorID": 352, "message": "it is another plugin's"}}
            connection.send(json.dumps({**about, "data": data} if data is not None else about | refused))
            if request["messageType"].startswith("Inject"):
                injections.append(request)
                if len(injections) == 1:
                    return  # it is ended, and started again

    with serve(handle, "127.0.0.1", 0) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield server.socket.getsockname()[1], requests
        server.shutdown()


@pytest.mark.parametrize("wrong", ["{", "[5]", '{"requestID": ID}', '{"requestID": ID, "messageType": "a", "data": 5}'])
def test_what_does_not_reply_as_vtube_studio_is_asked_again(token, wrong):
    token.write_bytes(b"\xff")  # damaged
    requests: Queue[dict[str, Any]] = Queue()

    def handle(connection):
        requests.put(json.loads(connection.recv()))
        connection.send(wrong.replace("ID", json.dumps(requests.queue[-1]["requestID"])))
        connection.recv()

    with serve(handle, "127.0.0.1", 0) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        with open_consumer(f"vtube:127.0.0.1:{server.socket.getsockname()[1]}", print):
            assert {requests.get(timeout=30)["messageType"] for _ in range(3)} == {"AuthenticationTokenRequest"}


def test_vtube_studio_is_asked_once_and_gets_the_newest_frame(studio, token):
    port, requests = studio

    def kinds_until_injected(take, shown):
        kinds: list[str] = []
        while not kinds or kinds[-1] != "InjectParameterDataRequest":
            repeat_until_any(lambda: take(shown), requests)
            request = requests.get()
            kinds.append(request["messageType"])
        return kinds, {each["id"]: each["value"] for each in request["data"]["parameterValues"]}

    shown = frame(1, jawOpen=0.25, mouthPucker=0.4)
    with open_consumer(f"vtube:127.0.0.1:{port}", print) as take:
        kinds, values = kinds_until_injected(take, shown)
        assert kinds[:3] == ["AuthenticationTokenRequest", "AuthenticationRequest", "InputParameterListRequest"]
        assert kinds.count("ParameterCreationRequest") == 4  # those that it has are not made
        assert set(values) == {
            *("MouthOpen", "MouthSmile", "JawOpen", "MouthFunnel", "MouthPucker", "MouthPressLipOpen")
        }
        assert values["MouthOpen"] == pytest.approx(0.5)
        assert values["MouthSmile"] == pytest.approx(0.4)
        assert values["MouthPucker"] == pytest.approx(-0.4)
        kinds, values = kinds_until_injected(take, frame(2, jawOpen=1.0))  # VTube Studio was started again
        assert kinds[0] == "AuthenticationRequest"
        assert "AuthenticationTokenRequest" not in kinds
        assert token.read_text("ascii") == "a-token"


def test_the_window_sends_sound_with_its_time_and_a_head_that_turns():
    with servers.open_server("window:0", 0) as server:
        window = LiveWindow(RATE_HZ, server)
        assert isinstance(window, Listener)
        with connect(f"ws://{server.address}/", proxy=None) as client:
            received: Queue[str | bytes] = Queue()
            Thread(target=lambda: list(map(received.put, client)), daemon=True).start()
            repeat_until_any(lambda: window(frame()), received)
            for value in (0.5, -0.25):
                window.hear(np.full(FRAME, value, np.float32))
            window(frame(3, headYaw=0.2))
            messages: list[str | bytes] = []
            while not messages or 'time_s":0.06' not in str(messages[-1]):
                messages.append(received.get(timeout=60))
    pieces = [message for message in messages if isinstance(message, bytes)]
    assert [struct.unpack("<d", piece[:8])[0] for piece in pieces] == [0.0, 0.02]
    assert np.frombuffer(pieces[1][8:], "<i2") == pytest.approx(np.full(FRAME, -8192), abs=1)
    turned = json.loads(messages[-1])["weights"]
    assert turned["head.rotation.y"] == pytest.approx(np.sin(0.1), abs=1e-3)
