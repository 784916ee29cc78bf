"""A page with the 3D head, which speaks what is heard: frames and sound over a WebSocket, three.js of the studio.

A message of text is a frame, as ``websocket`` sends them; the first one is ``{"rate_hz", "look_ahead_ms",
"is_microphone", "waits"}`` instead. A binary message is sound: the time where it begins, in seconds, as a float64, then
samples of 16 bits; both little-endian.
"""

from __future__ import annotations

import asyncio
import json
import struct
import webbrowser
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib.resources import files
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from lipmotion.cli.terminal.printing import print_error
from lipmotion.live.consumers import Consumer, LiveSound, json_line
from lipmotion.live.face import LiveFrame
from lipmotion.meshes.model.mesh import ANGLES, turn_head
from lipmotion_studio.live.servers import Server, open_server, to_pcm_16
from lipmotion_studio.web.listening import read_page

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

PORT = 8767
FIRST = "live/live.html"  # the page, whose address is empty
HEAD_FILE = "head.glb"
READY = "ready"  # what the page says when it shows what comes
TURN = tuple(f"head.rotation.{axis}" for axis in "xyzw")
"""Names of the quaternion that turns the head, as the page knows them."""
REJOIN_S = 1.5  # a page that is open from before connects again within this time, and no other one is opened
FILE_HEADERS = {
    "content-security-policy": "default-src 'self'; img-src 'self' blob: data:; connect-src 'self' ws: blob:; "
    "base-uri 'none'; form-action 'none'; object-src 'none'",
    "access-control-allow-origin": "*",  # pages of one's own may use the modules; frames and sound are for LOCAL ones
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}


class LiveWindow:
    """A consumer that pages are connected to.

    rate_hz : of the sound
    """

    def __init__(self, rate_hz: int, server: Server) -> None:
        self._rate_hz, self._server, self._heard = rate_hz, server, 0

    def hear(self, samples: Any) -> None:
        """Take sound."""
        sound = to_pcm_16(samples)
        self._server.send(struct.pack("<d", self._heard / self._rate_hz) + sound)
        self._heard += len(sound) // 2

    def __call__(self, frame: LiveFrame) -> None:
        """Take a frame."""
        (turn,) = turn_head(np.array([[frame.weights.get(name, 0.0) for name in ANGLES]])).tolist()
        turned = frame.weights | dict(zip(TURN, turn, strict=True))
        self._server.send(json_line(replace(frame, weights=turned)))


@contextmanager
def open_window(to: str, sound: LiveSound) -> Iterator[Consumer]:
    """Give a consumer that moves the head of a page, and speaks there.

    ``window`` opens the page in the user's browser and waits until it can be heard; ``window:HOST:PORT`` serves it for
    whoever comes. Raises as ``open_server``.
    """
    opens, joined, ready = ":" not in to, Event(), Event()
    greeting = {"rate_hz": sound.rate_hz, "look_ahead_ms": sound.look_ahead_ms}
    greeting |= {"is_microphone": sound.is_microphone, "waits": opens}
    head: Future[bytes] = Future()
    page = dict(read_page(files("lipmotion_studio") / "page"))
    reply = partial(_reply, page | {"": page[FIRST]}, head)
    server = Server(json.dumps(greeting), reply, joined.set, lambda message: ready.set() if message == READY else None)
    with open_server(to, PORT, server):
        Thread(target=_make_head, args=(head,), daemon=True).start()  # it takes seconds, in which the browser opens
        print_error(f"the page is at http://{server.address}/ (Ctrl-C ends)")
        if opens:
            if not joined.wait(REJOIN_S):
                webbrowser.open(f"http://{server.address}/")
            while not ready.wait(0.2):  # in steps, so that Ctrl-C ends it on Windows, too
                pass
        yield LiveWindow(sound.rate_hz, server)


def _make_head(head: Future[bytes]) -> None:
    from lipmotion_studio import meshes

    try:
        head.set_result(meshes.Faces({}).load_mesh(meshes.HEAD))
    except Exception as error:
        head.set_exception(error)  # the page is told
        raise


async def _reply(
    page: Mapping[str, tuple[bytes, str]], head: Future[bytes], connection: ServerConnection, request: Request
) -> Response:
    """Return what a request is answered: a file of the page, or the head, once it is made."""
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    path = request.path.partition("?")[0].lstrip("/")
    if path == HEAD_FILE:
        content, kind = await asyncio.wrap_future(head), "model/gltf-binary"
    elif path in page:
        content, kind = page[path]
    else:
        return connection.respond(404, "no such file")
    headers = Headers(FILE_HEADERS)
    headers["content-type"], headers["content-length"] = kind, str(len(content))
    return Response(200, "OK", headers, content)
