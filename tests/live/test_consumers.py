"""What takes live frames: packets as their receivers read them, files, the command line."""

import socket
import struct

import numpy as np
import pytest

from lipmotion import LiveFrame
from lipmotion.errors import InputError
from lipmotion.live.consumers import live_link_packet, open_consumer, osc_packet, vmc_packet
from lipmotion.live.face import WEIGHT_NAMES
from lipmotion.meshes.model.shape_names import ARKIT_52


def frame(number: int = 3) -> LiveFrame:
    weights = {name: (index + 1) / 100 for index, name in enumerate(WEIGHT_NAMES)}
    return LiveFrame(number * 0.02, number * 0.02 + 0.1, np.array([0.125, 0.5]), ("opening", "width"), weights)


def read_osc(packet: bytes) -> list[tuple[str, list[str | float]]]:
    """Return the messages of a bundle, by the rules of Open Sound Control 1.0."""
    assert packet[:8] == b"#bundle\0"
    place, messages = 16, []

    def text(content: bytes) -> tuple[str, bytes]:
        end = content.index(b"\0")
        return content[:end].decode(), content[end // 4 * 4 + 4 :]

    while place < len(packet):
        (size,) = struct.unpack(">i", packet[place : place + 4])
        address, rest = text(packet[place + 4 : place + 4 + size])
        kinds, rest = text(rest)
        arguments: list[str | float] = []
        for kind in kinds[1:]:
            if kind == "s":
                argument, rest = text(rest)
                arguments.append(argument)
            else:
                arguments.append(struct.unpack(">f", rest[:4])[0])
                rest = rest[4:]
        assert not rest
        messages.append((address, arguments))
        place += 4 + size
    return messages


def test_vmc_receivers_get_vowels_and_perfect_sync() -> None:
    *values, last = read_osc(vmc_packet(frame()))
    assert last == ("/VMC/Ext/Blend/Apply", [])
    assert {address for address, _ in values} == {"/VMC/Ext/Blend/Val"}
    named = {name: value for _, (name, value) in values}
    assert named["A"] == pytest.approx(frame()["viseme_aa"])
    assert named["jawOpen"] == pytest.approx(frame()["jawOpen"])


def test_osc_has_an_address_for_every_value() -> None:
    values = dict(read_osc(osc_packet(frame())))
    assert values["/lipmotion/opening"] == [pytest.approx(0.125)]
    assert len(values) == 2 + len(WEIGHT_NAMES)


def test_live_link_packets_are_read_as_by_the_app() -> None:
    packet = live_link_packet(frame())
    assert struct.unpack("<i", packet[:4]) == (6,)
    assert packet[4:5] == b"$"
    (size,) = struct.unpack(">i", packet[41:45])
    assert packet[45 : 45 + size] == b"lipmotion"
    number, sub, rate, over, count = struct.unpack(">if2iB", packet[45 + size : 62 + size])
    assert (number, sub, rate, over, count) == (3, 0, 50, 1, 61)
    values = dict(zip(ARKIT_52, struct.unpack(">61f", packet[62 + size :]), strict=False))
    assert values["jawOpen"] == pytest.approx(frame()["jawOpen"])
    assert values["eyeBlinkLeft"] == 0


def test_packets_are_read_by_the_receivers_own_parsers() -> None:
    reader = pytest.importorskip("pylivelinkface")
    osc = pytest.importorskip("pythonosc.osc_bundle")
    decoded, face = reader.PyLiveLinkFace.decode(live_link_packet(frame()))
    assert decoded
    assert face.get_blendshape(reader.FaceBlendShape.JawOpen) == pytest.approx(frame()["jawOpen"], abs=1e-3)
    assert face.get_blendshape(reader.FaceBlendShape.JawLeft) == pytest.approx(frame()["jawLeft"], abs=1e-3)
    messages = list(osc.OscBundle(vmc_packet(frame())))
    assert messages[0].address == "/VMC/Ext/Blend/Val"
    assert messages[0].params == ["A", pytest.approx(frame()["viseme_aa"])]


def test_frames_reach_a_receiver() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(20)
        with open_consumer(f"vmc:127.0.0.1:{receiver.getsockname()[1]}", print) as take:
            take(frame())
        assert receiver.recv(65_536) == vmc_packet(frame())


@pytest.mark.parametrize("to", ["nothing", "vmc:here:x", "osc:127.0.0.1:700000"])
def test_what_takes_no_frames_is_refused(to: str) -> None:
    with pytest.raises(InputError, match=f"--to {to}"), open_consumer(to, print):
        pass
