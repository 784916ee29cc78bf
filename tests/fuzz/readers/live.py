"""What reaches live motion: sound and words, bytes to its servers, what VTube Studio replies."""

import asyncio
import copy
import json
import math
import socket
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
from websockets.sync.client import connect

from fuzz.inputs import Files, Good
from fuzz.plausible import require, short_speech
from lipmotion import LiveFrame, Stream, errors
from lipmotion.storage import archive, json_text
from lipmotion_studio.live import servers, vtube

REPLIES: dict[str, dict[str, Any]] = {
    "AuthenticationRequest": {"data": {"authenticated": True}},
    "AuthenticationTokenRequest": {"data": {"authenticationToken": "token"}},
    "InputParameterListRequest": {"data": {"defaultParameters": [{"name": "MouthOpen"}], "customParameters": []}},
    "ParameterCreationRequest": {"data": {"parameterName": "JawOpen"}},
    "InjectParameterDataRequest": {"data": {}},
}
WORDS = [["baby", 0.1, 0.4], ["", 0.4, 0.5], ["<b>two</b>", 0.5, 0.9]]
UPGRADE = "upgrade: websocket\r\nconnection: Upgrade\r\nsec-websocket-version: 13\r\n"
REQUEST = f"GET / HTTP/1.1\r\nhost: localhost\r\n{UPGRADE}sec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
FRAME = b"\x81\x85\x01\x02\x03\x04" + bytes(a ^ b for a, b in zip(b"ready", b"\1\2\3\4\1", strict=True))


def seeds(good: Good) -> list[Files]:
    sound = short_speech(good).samples[:4000]
    with tempfile.TemporaryDirectory() as folder:
        for name, samples in (("mono", sound), ("stereo", np.stack([sound, sound], axis=1).astype(np.float64))):
            np.save(Path(folder) / f"{name}.npy", samples)
        arrays = [{path.name: path.read_bytes()} for path in sorted(Path(folder).iterdir())]
    raw = (sound * 32767).astype("<i2").tobytes()
    replies = {kind: {"requestID": "ID", "messageType": kind} | reply for kind, reply in REPLIES.items()}
    texts = {"words.json": WORDS, "phones.json": [["b", 0.1, 0.2], ["ey1", 0.2, 0.4]], "replies.json": replies}
    found = [{name: json.dumps(content).encode()} for name, content in texts.items()]
    return [*found, *arrays, {"sound.raw": raw}, {"client.http": REQUEST.encode() + FRAME}]


def read(folder: Path, good: Good) -> None:
    """Move a mouth by the sound or the words; or talk to the server, which then still serves others."""
    (path,) = folder.iterdir()
    content = path.read_bytes()
    if path.suffix == ".http":
        _send(content)
    elif path.name == "replies.json":
        asyncio.run(_converse(_parsed(content)))
    else:
        stream = copy.deepcopy(_stream())
        frames = []
        if path.suffix == ".json":
            (stream.add_words if path.stem == "words" else stream.add_phones)(_parsed(content))
        else:
            frames = stream.push(content if path.suffix == ".raw" else _array(content))
        frames += stream.push(short_speech(good).samples[:8000]) + stream.flush()
        require([frame.number for frame in frames] == list(range(len(frames))), "frames that are missing")
        require(all(_is_finite(frame) for frame in frames), "a frame that is not finite")


def _parsed(content: bytes) -> Any:
    """Return what a program sends that parses JSON."""
    try:
        return json_text.from_json(content)
    except ValueError as error:
        raise errors.InputError(str(error)) from error


def _array(content: bytes) -> Any:
    try:
        array = archive.take_array(content)
    except ValueError as error:
        raise errors.InputError(str(error)) from error
    return array if array.size < 1e6 else array.ravel()[:1_000_000]


def _is_finite(frame: LiveFrame) -> bool:
    return bool(np.isfinite(frame.motion).all()) and all(map(math.isfinite, frame.weights.values()))


@cache
def _stream() -> Stream:
    return Stream(look_ahead_ms=80)


def _send(content: bytes) -> None:
    server = servers.Server("hello")
    with servers.open_server("websocket:127.0.0.1:0", 0, server):
        host, _, port = server.address.rpartition(":")
        with socket.create_connection((host, int(port)), timeout=5) as client, suppress(OSError):
            client.sendall(content)
            client.shutdown(socket.SHUT_WR)
            while client.recv(1 << 16):
                pass
        with connect(f"ws://{host}:{port}/", proxy=None) as other:
            require(other.recv(timeout=10) == "hello", "a server that no longer greets")


class _Studio:
    """A connection to a VTube Studio whose replies are given; the second connection ends the conversation."""

    def __init__(self, replies: Any) -> None:
        self._replies, self._asked, self._connections = replies, list[dict[str, Any]](), 0

    def __await__(self) -> Generator[None, None, "_Studio"]:
        self._connections += 1
        if self._connections > 1:
            raise asyncio.CancelledError
        return self
        yield

    async def close(self) -> None:
        self.transport = SimpleNamespace(abort=self._asked.clear)

    async def send(self, text: str) -> None:
        self._asked.append(json.loads(text))

    async def recv(self) -> str:
        if not self._asked or len(self._asked) > 20:
            raise OSError("it has ended")
        question = self._asked.pop()
        kind = question["messageType"]
        reply = self._replies.get(kind) if isinstance(self._replies, dict) else self._replies
        return json.dumps(reply).replace('"ID"', json.dumps(question["requestID"]))


async def _converse(replies: Any) -> None:
    with tempfile.TemporaryDirectory() as folder, ExitStack() as patches:
        studio, connection = vtube.VTubeStudio("ws://nowhere", Path(folder) / "token"), _Studio(replies)
        patches.enter_context(mock.patch("websockets.asyncio.client.connect", return_value=connection))
        patches.enter_context(mock.patch("lipmotion_studio.live.vtube.AGAIN_S", 0.0))
        studio(copy.deepcopy(_stream()).push(np.zeros(8000, np.float32))[-1])
        with suppress(asyncio.CancelledError, TimeoutError):
            await asyncio.wait_for(studio.work(), 0.05)
