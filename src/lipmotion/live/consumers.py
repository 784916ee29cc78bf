"""What takes live frames: VMC and OSC receivers, Unreal's Live Link, files, other programs through a pipe.

Sources: VMC protocol (VirtualMotionCapture, ``/VMC/Ext/Blend/Val``, ``/VMC/Ext/Blend/Apply``); Open Sound Control 1.0;
packets of Live Link Face as PyLiveLinkFace reads them.
"""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from lipmotion.errors import InputError
from lipmotion.live.face import LiveFrame
from lipmotion.live.network import STEP_S
from lipmotion.meshes.model.mesh import ANGLES
from lipmotion.meshes.model.shape_names import ARKIT_52
from lipmotion.storage.files import atomic_file

Consumer = Callable[[LiveFrame], None]
PORTS = {"vmc": 39539, "osc": 9000, "livelink": 11111}
"""The ports at which these receivers listen unless they are told another one."""
VRM_VOWELS = {"A": ("aa",), "I": ("ih",), "U": ("ou",), "E": ("E",), "O": ("oh",)}
"""The blend shapes of VRM 0 that VMC receivers have, and the visemes of Oculus that they are."""
SUBJECT = "lipmotion"
DEVICE = "$00000000-0000-0000-0000-6c69706d6f74"
"""The device of Live Link packets: 37 characters, as the app sends them."""
HEAD_SIGNS = (1.0, -1.0, 1.0)
"""Live Link's head pitch is positive downwards."""
EYES = 6
"""Angles of both eyes in a Live Link packet, which their blendshapes turn instead."""


@contextmanager
def open_consumer(to: str, print_line: Callable[[str], None]) -> Iterator[Consumer]:
    """Give what takes frames.

    to         : ``-`` (lines of JSON), FILE.csv, or ``vmc``, ``osc``, ``livelink``, perhaps with :HOST:PORT behind it
    print_line : prints a line
    Raises InputError: none of these. ExportError: the file cannot be written.
    """
    kind, _, address = to.partition(":")
    if to == "-":
        yield lambda frame: print_line(json_line(frame))
    elif to.lower().endswith(".csv"):
        with atomic_file(Path(to)) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
            yield lambda frame: _write(file, csv_lines(frame))
    elif kind in PORTS:
        host, _, port = address.rpartition(":")
        try:
            place = host or "127.0.0.1", int(port or PORTS[kind])
            family = socket.getaddrinfo(*place, type=socket.SOCK_DGRAM)[0][0]
            struct.pack(">H", place[1])
        except (ValueError, OSError, struct.error) as error:
            raise InputError(
                f"--to {to}: no such address ({error}); required {kind}:PORT or {kind}:HOST:PORT"
            ) from error
        packets = {"vmc": vmc_packet, "osc": osc_packet, "livelink": live_link_packet}[kind]
        with socket.socket(family, socket.SOCK_DGRAM) as channel:
            yield lambda frame: _send(channel, packets(frame), place)
    else:
        raise InputError(f"--to {to}: required -, a FILE.csv, or one of {', '.join(PORTS)}, perhaps with :HOST:PORT")


def _write(file: TextIO, lines: str) -> None:
    file.write(lines)


def _send(channel: socket.socket, packet: bytes, place: tuple[str, int]) -> None:
    try:
        channel.sendto(packet, place)
    except ConnectionRefusedError:
        return  # nobody listens yet: whoever begins to listen later is sent the frames from then on


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
    vowels = {name: sum(frame[f"viseme_{each}"] for each in visemes) for name, visemes in VRM_VOWELS.items()}
    arkit = {name: value for name, value in frame.weights.items() if not name.startswith("viseme_")}
    messages = [osc_message("/VMC/Ext/Blend/Val", name, value) for name, value in {**vowels, **arkit}.items()]
    return osc_bundle([*messages, osc_message("/VMC/Ext/Blend/Apply")])


def osc_packet(frame: LiveFrame) -> bytes:
    """Return every weight, and opening and width, each at an address of its own."""
    shown = {name: frame[name] for name in ("opening", "width") if name in frame.names} | frame.weights
    return osc_bundle([osc_message(f"/lipmotion/{name}", value) for name, value in shown.items()])


def live_link_packet(frame: LiveFrame) -> bytes:
    """Return the packet that the Live Link Face app would send: 52 blendshapes, then head and eyes, radians."""
    head = [frame.weights.get(name, 0.0) * sign for name, sign in zip(ANGLES, HEAD_SIGNS, strict=True)]
    values = [frame.weights.get(name, 0.0) for name in ARKIT_52] + head + [0.0] * EYES
    name, rate = SUBJECT.encode(), round(1 / STEP_S)
    head = struct.pack("<I", 6) + DEVICE.encode() + struct.pack(">i", len(name)) + name
    return (
        head + struct.pack(">IfII", frame.number, 0.0, rate, 1) + struct.pack(f">B{len(values)}f", len(values), *values)
    )
