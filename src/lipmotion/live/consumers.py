"""What takes live frames: VMC and OSC receivers, Unreal's Live Link, files, other programs through a pipe.

Further ones are entry points of the group ``lipmotion.live``: functions of what stands behind ``--to`` and a
``LiveSound``, which return a context manager that gives a ``Consumer``.

Sources: VMC protocol (VirtualMotionCapture, ``/VMC/Ext/Blend/Val``, ``/VMC/Ext/Blend/Apply``); Open Sound Control 1.0;
packets of Live Link Face as PyLiveLinkFace reads them.
"""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from lipmotion.errors import InputError
from lipmotion.extensions import Registry
from lipmotion.live.face import LiveFrame
from lipmotion.live.network import STEP_S
from lipmotion.meshes.model.mesh import ANGLES
from lipmotion.meshes.model.shape_names import ARKIT_52
from lipmotion.storage.files import atomic_file
from lipmotion.types import SPEECH_RATE_HZ

Consumer = Callable[[LiveFrame], object]


@runtime_checkable
class Listener(Protocol):
    """A consumer that takes the sound, too."""

    def __call__(self, frame: LiveFrame) -> None:
        """Take a frame."""

    def hear(self, samples: Any) -> None:
        """Take sound as ``Stream.push`` does, before the frames that it completes."""


@dataclass(frozen=True)
class LiveSound:
    """What consumers know of the sound.

    rate_hz       : of the sound that listeners hear
    look_ahead_ms : how late the frames come
    is_microphone : whether it is heard in the room already
    """

    rate_hz: int = SPEECH_RATE_HZ
    look_ahead_ms: float = 160.0
    is_microphone: bool = False


CONSUMERS: Registry[Callable[[str, LiveSound], AbstractContextManager[Consumer]]] = Registry(
    "consumer of live frames", "lipmotion.live", {}
)
LARGEST_PORT = 65_535
PORTS = {"vmc": 39539, "osc": 9000, "livelink": 11111}
"""The ports at which these receivers listen unless they are told another one."""
VMC_VOWELS = {"A": "aa", "I": "ih", "U": "ou", "E": "E", "O": "oh"}
"""The blend shapes of VRM 0 that VMC receivers have, and the visemes of Oculus that they are."""
SUBJECT = "lipmotion"
DEVICE = "$00000000-0000-0000-0000-6c69706d6f74"
"""The device of Live Link packets: 37 characters, as the app sends them."""
HEAD_SIGNS = (1.0, -1.0, 1.0)  # Live Link's head pitch is positive downwards
EYES = 6  # angles of both eyes in a Live Link packet, which their blendshapes turn instead


@contextmanager
def open_consumer(to: str, print_line: Callable[[str], None], sound: LiveSound | None = None) -> Iterator[Consumer]:
    """Give what takes frames, and the sound, where it is a ``Listener``.

    to         : ``-`` (lines of JSON), FILE.csv, or a name as ``vmc``, perhaps with :HOST:PORT behind it
    print_line : prints a line
    sound      : that the frames belong to; None: 16 kHz, with the usual look-ahead
    Raises InputError: none of these. ExportError: no writable file. MissingDependencyError: a package is not installed.
    """
    kind = to.partition(":")[0]
    if to == "-":
        yield lambda frame: print_line(json_line(frame))
    elif to.lower().endswith(".csv"):
        with atomic_file(Path(to)) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
            yield lambda frame: file.write(csv_lines(frame))
    elif kind in PORTS:
        place = read_address(to, PORTS[kind])
        try:
            family = socket.getaddrinfo(*place, type=socket.SOCK_DGRAM)[0][0]
        except OSError as error:
            raise InputError(f"--to {to}: no such address ({error})") from error
        packets = {"vmc": vmc_packet, "osc": osc_packet, "livelink": live_link_packet}[kind]
        with socket.socket(family, socket.SOCK_DGRAM) as channel:
            yield lambda frame: _send(channel, packets(frame), place)
    elif kind in CONSUMERS.names:
        with CONSUMERS.load(kind)(to, sound or LiveSound()) as consumer:
            yield consumer
    else:
        names = ", ".join((*PORTS, *CONSUMERS.names))
        raise InputError(f"--to {to}: required -, a FILE.csv, or one of {names}, perhaps with :HOST:PORT")


def read_address(to: str, port: int) -> tuple[str, int]:
    """Return host and port of KIND, KIND:PORT or KIND:HOST:PORT; this machine, and ``port``, where they are left out.

    Raises InputError: something else.
    """
    kind, _, address = to.partition(":")
    host, _, digits = address.rpartition(":")
    number = int(digits or port) if (digits or "0").isdecimal() else -1
    if not 0 <= number <= LARGEST_PORT:
        raise InputError(f"--to {to}: no such address; required {kind}:PORT or {kind}:HOST:PORT")
    return host.strip("[]") or "127.0.0.1", number


def _send(channel: socket.socket, packet: bytes, place: tuple[str, int]) -> None:
    with suppress(ConnectionRefusedError):  # nobody listens yet: whoever begins later is sent the frames from then on
        channel.sendto(packet, place)


def json_line(frame: LiveFrame) -> str:
    """Return a frame as one line of JSON: times, opening and width, the weights that are not 0."""
    weights = {name: round(value, 4) for name, value in frame.weights.items() if abs(value) >= 5e-5}
    shown = {name: round(frame[name], 5) for name in ("opening", "width") if name in frame.names}
    times = {"time_s": round(frame.time_s, 3), "known_s": round(frame.known_s, 4)}
    return json.dumps({**times, **shown, "weights": weights}, separators=(",", ":"))


def csv_lines(frame: LiveFrame) -> str:
    """Return the line of a frame in a CSV file: times, channels, weights; before the first one, their names."""
    values = [frame.time_s, frame.known_s, *frame.motion.tolist(), *frame.weights.values()]
    line = ",".join(f"{value:.6g}" for value in values) + "\n"
    if frame.number:
        return line
    return ",".join(["time_s", "known_s", *frame.names, *frame.weights]) + "\n" + line


def osc_message(address: str, *arguments: str | float) -> bytes:
    """Return a message of Open Sound Control: strings and floats."""

    def padded(text: str) -> bytes:
        content = text.encode()
        return content + b"\0" * (4 - len(content) % 4)

    kinds = "," + "".join("s" if isinstance(each, str) else "f" for each in arguments)
    parts = [padded(each) if isinstance(each, str) else struct.pack(">f", each) for each in arguments]
    return padded(address) + padded(kinds) + b"".join(parts)


def osc_bundle(messages: list[bytes]) -> bytes:
    """Return messages that a receiver takes at once."""
    return b"#bundle\0" + struct.pack(">Q", 1) + b"".join(struct.pack(">i", len(each)) + each for each in messages)


def vmc_packet(frame: LiveFrame) -> bytes:
    """Return the vowels of VRM, and ARKit's blendshapes for "perfect sync", as VMC receivers take them."""
    vowels = {name: frame[f"viseme_{viseme}"] for name, viseme in VMC_VOWELS.items()}
    arkit = {name: value for name, value in frame.weights.items() if not name.startswith("viseme_")}
    messages = [osc_message("/VMC/Ext/Blend/Val", name, value) for name, value in {**vowels, **arkit}.items()]
    return osc_bundle([*messages, osc_message("/VMC/Ext/Blend/Apply")])


def osc_packet(frame: LiveFrame) -> bytes:
    """Return every weight, and opening and width, each at an address of its own."""
    shown = {name: frame[name] for name in ("opening", "width") if name in frame.names} | frame.weights
    return osc_bundle([osc_message(f"/lipmotion/{name}", value) for name, value in shown.items()])


def live_link_packet(frame: LiveFrame) -> bytes:
    """Return the packet that the Live Link Face app would send: 52 blendshapes, then head and eyes, radians."""
    turned = [frame.weights.get(name, 0.0) * sign for name, sign in zip(ANGLES, HEAD_SIGNS, strict=True)]
    values = [frame.weights.get(name, 0.0) for name in ARKIT_52] + turned + [0.0] * EYES
    name, rate = SUBJECT.encode(), round(1 / STEP_S)
    head = struct.pack("<I", 6) + DEVICE.encode() + struct.pack(">i", len(name)) + name
    head += struct.pack(">IfII", frame.number, 0.0, rate, 1)
    return head + struct.pack(f">B{len(values)}f", len(values), *values)
