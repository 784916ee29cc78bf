"""Sound and mouth for TalkingHead in a browser, as its methods take them.

Every message is JSON, ``{"call": NAME, "argument": {…}}``, and a page calls the method of that name: ``streamStart``,
``streamAudio``, whose ``audio`` is base64 of samples of 16 bits, ``streamInterrupt``.
Source: TalkingHead 1.7 (npm ``@met4citizen/talkinghead``), appendix G of its README, and ``animFactory``: an animation
of the type ``blendshapes`` begins ``delay`` ms after the sound has begun, and reaches its values ``vs`` after ``dt``.
"""

from __future__ import annotations

import base64
import json
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from lipmotion.cli.terminal.printing import print_error
from lipmotion.errors import InputError
from lipmotion.live.consumers import Consumer, LiveSound
from lipmotion.live.face import LiveFrame
from lipmotion.live.network import STEP_S
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH
from lipmotion_studio.live.servers import Server, open_server, to_pcm_16

PORT = 8766
RATES_HZ = (8_000, 96_000)  # sampling rates that ``streamStart`` takes
STEP_MS = 1000 * STEP_S
AHEAD = 10  # frames that are sent before any is heard, so that no gap is heard where one comes late: 200 ms
PAUSE = 50
"""Silent frames after which the next speech begins anew, so that the clocks of sound and mouth stay together: 1 s."""
SILENT = 0.5  # weight of the viseme of silence from which on a frame is silent


class TalkingHead:
    """A consumer that calls TalkingHead's methods.

    rate_hz : of the sound
    server  : that pages are connected to
    """

    def __init__(self, rate_hz: int, server: Server) -> None:
        self._server, self._samples = server, rate_hz * STEP_S  # of a frame, perhaps no whole number
        self._sound, self._taken = bytearray(), 0  # sound that no frame has come for, and frames that were before it
        self._frames: deque[LiveFrame] = deque()
        self._held: deque[tuple[LiveFrame, bytes]] = deque(maxlen=AHEAD)
        self._begin_s: float | None = None  # the time in the sound where the speech that is sent began; None: a pause
        self._silent = 0
        self.has_newcomer = False

    def hear(self, samples: Any) -> None:
        """Take sound; it is sent with its frames."""
        self._sound += to_pcm_16(samples)
        self._match()

    def __call__(self, frame: LiveFrame) -> None:
        """Take a frame; it is sent with its sound."""
        self._frames.append(frame)
        self._match()

    def finish(self) -> None:
        """Send what is held."""
        for frame in self._frames:
            self._hold(frame, bytes(self._sound))
            self._sound.clear()
        self._frames.clear()
        if self._silent < AHEAD:
            self._send_held()
        self._call("streamNotifyEnd")

    def interrupt(self) -> None:
        """Be silent and rest at once; the frames that ``Stream.interrupt`` returns are not to be taken."""
        self._frames.clear()
        self._held.clear()
        self._sound.clear()
        self._taken = 0
        self._pause()

    def _match(self) -> None:
        """Send the frames whose sound is there."""
        while self._frames:
            count = 2 * (round((self._taken + 1) * self._samples) - round(self._taken * self._samples))
            if len(self._sound) < count:
                return
            self._taken += 1
            self._hold(self._frames.popleft(), bytes(self._sound[:count]))
            del self._sound[:count]

    def _hold(self, frame: LiveFrame, sound: bytes) -> None:
        if self.has_newcomer:
            self.has_newcomer = False
            self._pause()  # a page's clock begins with the first sound that it gets
        self._silent = self._silent + 1 if frame["viseme_sil"] >= SILENT else 0
        if self._begin_s is not None and self._silent >= PAUSE:
            self._pause()
        if self._begin_s is not None:
            self._send(frame, sound)
            return
        self._held.append((frame, sound))
        if len(self._held) == AHEAD and self._silent < AHEAD:
            self._send_held()

    def _send_held(self) -> None:
        for frame, sound in self._held:
            self._send(frame, sound)
        self._held.clear()

    def _send(self, frame: LiveFrame, sound: bytes) -> None:
        if self._begin_s is None:
            self._begin_s = frame.time_s
        animation = {
            "name": "blendshapes",  # what ``streamInterrupt`` takes away
            "delay": round(1000 * (frame.time_s - self._begin_s) - STEP_MS, 1),
            "dt": [STEP_MS],
            "vs": {name: [round(frame.weights[name], 4)] for name in ARKIT_MOUTH},
        }
        self._call("streamAudio", audio=base64.b64encode(sound).decode(), anims=[animation])

    def _pause(self) -> None:
        self._begin_s = None
        self._call("streamInterrupt")

    def _call(self, name: str, **argument: Any) -> None:
        self._server.send(call(name, **argument))


def call(name: str, **argument: Any) -> str:
    """Return the message that has a method called."""
    return json.dumps({"call": name, "argument": argument}, separators=(",", ":"))


@contextmanager
def open_talking_head(to: str, sound: LiveSound) -> Iterator[Consumer]:
    """Give a consumer that pages with TalkingHead connect to.

    Raises InputError: as ``open_server``, or a sampling rate that TalkingHead refuses.
    """
    if not RATES_HZ[0] <= sound.rate_hz <= RATES_HZ[1]:
        low, high = RATES_HZ
        raise InputError(f"--to {to}: TalkingHead takes {low} to {high} Hz, and the sound has {sound.rate_hz} Hz")
    head: TalkingHead

    def join() -> None:
        head.has_newcomer = True

    server = Server(call("streamStart", sampleRate=sound.rate_hz, lipsyncType="blendshapes"), joined=join)
    head = TalkingHead(sound.rate_hz, server)
    with open_server(to, PORT, server):
        print_error(f"calls of TalkingHead are at ws://{server.address}/")
        try:
            yield head
        finally:
            head.finish()
