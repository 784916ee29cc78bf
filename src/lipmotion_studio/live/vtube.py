"""Live frames for VTube Studio, over its public API.

Source: the page "VTube Studio Public API" of DenchiSoft/VTubeStudio. Parameters of the mouth that it does not have
itself are made by the names and ranges under which characters are rigged for ARKit, those of VBridger.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import logging
import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from lipmotion.errors import ExportError, InputError
from lipmotion.live.consumers import Consumer, LiveSound, read_address
from lipmotion.live.face import LiveFrame
from lipmotion.meshes.model.mesh import ANGLES
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import catch_errors, from_json
from lipmotion_studio.live.servers import CLOSE_S, check_websockets, run_in_background

PORT = 8001
PLUGIN = {"pluginName": "lipmotion", "pluginDeveloper": "lipmotion"}
AGAIN_S = 1.0  # how long after it was not there VTube Studio is looked for again
OPEN_JAW = 0.5  # weight of ``jawOpen`` at which ``MouthOpen`` is 1: nobody opens the jaw wider while speaking
MADE = {
    "JawOpen": (0, 1),
    "MouthFunnel": (0, 1),
    "MouthShrug": (0, 1),
    "MouthPucker": (-1, 1),
    "MouthPressLipOpen": (-1.3, 1.3),
}
"""Parameters that are made where they are not there, with their ranges."""
REPLY = "a reply of VTube Studio"
LOG = logging.getLogger("lipmotion")


def list_parameters(frame: LiveFrame) -> dict[str, float]:
    """Return the parameters of the mouth, and of lids and head, where the frame moves them."""

    def sum_sides(name: str) -> float:
        return frame[f"{name}Left"] + frame[f"{name}Right"]

    wide = sum_sides("mouthSmile") + sum_sides("mouthStretch") + sum_sides("mouthDimple") / 2
    narrow = sum_sides("mouthFrown") + frame["mouthPucker"]
    parted = (sum_sides("mouthUpperUp") + sum_sides("mouthLowerDown")) / 1.8
    pressed = frame["mouthRollLower"] + frame["mouthRollUpper"]
    living = {}
    if "headYaw" in frame.weights:
        living = {f"EyeOpen{side}": 1 - frame[f"eyeBlink{side}"] for side in ("Left", "Right")}
        living |= {f"FaceAngle{axis}": math.degrees(frame[name]) for axis, name in zip("XYZ", ANGLES, strict=True)}
    return living | {
        "MouthOpen": min(max(frame["jawOpen"] - frame["mouthClose"], 0.0) / OPEN_JAW, 1.0),
        "MouthSmile": min(max(0.5 + (wide - narrow) / 4, 0.0), 1.0),  # 0.5 is neither a smile nor a pout
        "MouthX": frame["mouthLeft"] - frame["mouthRight"],
        "TongueOut": frame["tongueOut"],
        "JawOpen": frame["jawOpen"],
        "MouthFunnel": frame["mouthFunnel"],
        "MouthShrug": (frame["mouthShrugUpper"] + frame["mouthShrugLower"] + sum_sides("mouthPress")) / 4,
        "MouthPucker": min(max(2 * sum_sides("mouthDimple") - frame["mouthPucker"], -1.0), 1.0),
        "MouthPressLipOpen": min(max(parted - pressed, -1.3), 1.3),
    }


class VTubeStudio:
    """A consumer that sends the newest frame to VTube Studio whenever that has taken the one before."""

    def __init__(self, address: str, token_file: Path) -> None:
        self._address, self._token_file = address, token_file
        self._frame: LiveFrame | None = None
        self._is_new = asyncio.Event()
        self._numbers = itertools.count(1)
        self._loop: asyncio.AbstractEventLoop | None = None

    def __call__(self, frame: LiveFrame) -> None:
        """Take a frame."""
        self._frame = frame
        if self._loop is not None:
            with suppress(RuntimeError):  # the user has refused
                self._loop.call_soon_threadsafe(self._is_new.set)

    @contextmanager
    def connect(self) -> Iterator[None]:
        """Send frames until the end of the block."""
        with run_in_background(self.work()) as self._loop:
            yield

    async def work(self) -> None:
        """Send frames, connect again whenever VTube Studio is not there; end where its user refuses."""
        from websockets.asyncio.client import connect
        from websockets.exceptions import WebSocketException

        was_warned = False
        while True:
            try:
                connection = await connect(self._address, compression=None, close_timeout=CLOSE_S, proxy=None)
                try:
                    was_warned = False
                    if not await self._authenticate(connection):
                        LOG.warning("VTube Studio was told not to let lipmotion in; allow it there, and begin again")
                        return
                    await self._send_frames(connection, await self._find_parameters(connection))
                finally:
                    try:
                        await connection.close()
                    finally:  # where it is cancelled before
                        connection.transport.abort()
            except (OSError, WebSocketException, TimeoutError, asyncio.TimeoutError, InputError):
                if not was_warned:
                    LOG.warning("VTube Studio is not at %s; start it, and allow plugins to use its API", self._address)
                was_warned = True
                await asyncio.sleep(AGAIN_S)

    async def _authenticate(self, connection: Any) -> bool:
        """Authenticate by the stored token, or ask for one, which the user may refuse."""
        with suppress(OSError, ValueError):
            token = self._token_file.read_text("ascii")
            reply = await self._ask(connection, "AuthenticationRequest", **PLUGIN, authenticationToken=token)
            if reply.get("authenticated"):
                return True
        reply = await self._ask(connection, "AuthenticationTokenRequest", **PLUGIN)
        token = str(reply.get("authenticationToken") or "")
        if not token:
            return False
        with suppress(
            OSError, ExportError, ValueError
        ):  # where nothing can be stored, the user is asked again next time
            self._token_file.parent.mkdir(parents=True, exist_ok=True)
            with atomic_file(self._token_file) as temporary:
                temporary.touch(mode=0o600)
                temporary.write_text(token, "ascii")
        reply = await self._ask(connection, "AuthenticationRequest", **PLUGIN, authenticationToken=token)
        return bool(reply.get("authenticated"))

    async def _find_parameters(self, connection: Any) -> set[str]:
        """Return the parameters that can be set; those of ``MADE`` are made where they are not there."""
        reply = await self._ask(connection, "InputParameterListRequest")
        kinds = ("defaultParameters", "customParameters")
        with catch_errors(REPLY):
            names = {str(dict(each)["name"]) for kind in kinds for each in list(reply.get(kind, ()))}
        for name, (low, high) in MADE.items():
            if name not in names:
                about = {"explanation": "mouth of speech, by lipmotion", "min": low, "max": high, "defaultValue": 0}
                reply = await self._ask(connection, "ParameterCreationRequest", parameterName=name, **about)
                names.add(str(reply.get("parameterName")))
        return names

    async def _send_frames(self, connection: Any, names: set[str]) -> None:
        while True:
            await self._is_new.wait()
            self._is_new.clear()
            if self._frame is not None:
                values = list_parameters(self._frame).items()
                listed = [{"id": name, "value": value} for name, value in values if name in names]
                about = {"faceFound": True, "mode": "set", "parameterValues": listed}
                await self._ask(connection, "InjectParameterDataRequest", **about)

    async def _ask(self, connection: Any, kind: str, **data: Any) -> dict[str, Any]:
        """Return the data of the reply to a request; empty: it was refused. Raises InputError: no such reply."""
        number = str(next(self._numbers))
        about = {"apiName": "VTubeStudioPublicAPI", "apiVersion": "1.0", "requestID": number, "messageType": kind}
        await connection.send(json.dumps({**about, "data": data}))
        with catch_errors(REPLY):
            while True:
                reply = dict(from_json(await connection.recv()))
                if reply.get("requestID") == number:
                    return dict(reply["data"]) if reply["messageType"] != "APIError" else {}


@contextmanager
def open_vtube(to: str, sound: LiveSound) -> Iterator[Consumer]:  # noqa: ARG001
    """Give a consumer that sets VTube Studio's parameters of the mouth.

    Raises InputError: no such address. MissingDependencyError: websockets is not installed.
    """
    check_websockets(to)
    host, port = read_address(to, PORT)
    studio = VTubeStudio(f"ws://{f'[{host}]' if ':' in host else host}:{port}", find_cache() / "vtube-studio.token")
    with studio.connect():
        yield studio


def find_cache() -> Path:
    """Return the folder of what this user's programs keep, for lipmotion."""
    home = Path.home()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "lipmotion"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "lipmotion"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "lipmotion"
