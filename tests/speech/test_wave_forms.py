"""Forms of WAVE files and their kin: each holds the samples of a plain file of 16 bits."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import read_audio

RATE_HZ = 16_000
TONE = 0.4 * np.sin(2 * np.pi * 300 * np.arange(RATE_HZ // 4) / RATE_HZ)
PCM, FLOAT, ULAW, EXTENSIBLE = 1, 3, 7, 0xFFFE
GUID = bytes.fromhex("000000001000800000aa00389b71")
WAVE64 = bytes.fromhex("f3acd3118cd100c04f8edb8a")


def samples(valid: int, container: int, high_first: bool = False) -> bytes:
    """Samples of so many bits, at the left of containers of so many, with zeros behind them."""
    whole = np.round(TONE * 2.0 ** (valid - 1)).astype(np.int64) << (container - valid)
    if container == 8:
        return (whole + 128).astype(np.uint8).tobytes()
    bytes_of_each = whole.astype("<i8").view(np.uint8).reshape(-1, 8)[:, : container // 8]
    return bytes_of_each[:, :: -1 if high_first else 1].tobytes()


def form(bits: int = 16, *, coding: int = PCM, block: int | None = None, per_second: int | None = None) -> bytes:
    block = bits // 8 if block is None else block
    return struct.pack("<HHIIHH", coding, 1, RATE_HZ, per_second or block * RATE_HZ, block, bits)


def long_form(valid: int, container: int, coding: int = PCM) -> bytes:
    return form(container, coding=EXTENSIBLE) + struct.pack("<HHIH", 22, valid, 4, coding) + GUID


def chunk(name: bytes, body: bytes, length: int | None = None, pad: bool = True) -> bytes:
    return name + struct.pack("<I", len(body) if length is None else length) + body + b"\0" * (pad and len(body) % 2)


def wave(*chunks: bytes, kind: bytes = b"RIFF", length: int | None = None) -> bytes:
    body = b"WAVE" + b"".join(chunks)
    return kind + struct.pack("<I", len(body) if length is None else length) + body


def wave64(*chunks: tuple[bytes, bytes]) -> bytes:
    body = b"wave" + WAVE64
    for name, content in chunks:
        body += name + WAVE64 + struct.pack("<Q", 24 + len(content)) + content + bytes(-len(content) % 8)
    return b"riff" + bytes.fromhex("2e91cf11a5d628db04c10000") + struct.pack("<Q", 24 + len(body)) + body


def aifc(kind: bytes, bits: int, content: bytes) -> bytes:
    rate = bytes.fromhex("400cfa00000000000000")
    common = struct.pack(">HIH", 1, len(TONE), bits) + rate + kind + bytes(2)
    body = b"AIFC" + b"".join(
        name + struct.pack(">I", len(part)) + part for name, part in ((b"COMM", common), (b"SSND", bytes(8) + content))
    )
    return b"FORM" + struct.pack(">I", len(body)) + body


def wide(length: int) -> bytes:
    return chunk(b"ds64", struct.pack("<QQQI", length + 72, length, len(TONE), 0))


S16, S24_IN_32 = samples(16, 16), samples(24, 32)
F32, F64 = TONE.astype("<f4").tobytes(), TONE.astype("<f8").tobytes()
SOUND, TO_THE_END = chunk(b"data", S16), 0xFFFFFFFF
FORMS = {
    "24 in 32 without the longer header": wave(chunk(b"fmt ", form(24, block=4)), chunk(b"data", S24_IN_32)),
    "20 in 24 without it": wave(chunk(b"fmt ", form(20, block=3)), chunk(b"data", samples(20, 24))),
    "12 in 16 without it": wave(chunk(b"fmt ", form(12, block=2)), chunk(b"data", samples(12, 16))),
    "valid bits more than there are": wave(chunk(b"fmt ", long_form(24, 16)), SOUND),
    "valid bits not said": wave(chunk(b"fmt ", long_form(0, 16)), SOUND),
    "the longer header cut off": wave(chunk(b"fmt ", form(16, coding=EXTENSIBLE) + bytes(2)), SOUND),
    **{
        f"float of {8 * len(content) // len(TONE)} bits, {valid} valid": wave(
            chunk(b"fmt ", long_form(valid, 8 * len(content) // len(TONE), FLOAT)), chunk(b"data", content)
        )
        for content, valids in ((F32, (0, 16, 24, 32)), (F64, (0, 24, 32, 64)))
        for valid in valids
    },
    "a length of 0": wave(chunk(b"fmt ", form()), chunk(b"data", S16, 0), length=0),
    "a length to the end": wave(chunk(b"fmt ", form()), chunk(b"data", S16, TO_THE_END), length=TO_THE_END),
    "24 in 32, a length of 0": wave(chunk(b"fmt ", long_form(24, 32)), chunk(b"data", S24_IN_32, 0), length=0),
    "a frame of no bytes": wave(chunk(b"fmt ", form(16, block=0, per_second=32_000)), SOUND),
    "a frame of too many bytes": wave(chunk(b"fmt ", form(16, block=4, per_second=32_000)), SOUND),
    "a padded chunk of odd length": wave(chunk(b"fmt ", form()), chunk(b"junk", b"12345"), SOUND),
    "an odd chunk without its pad": wave(chunk(b"fmt ", form()), chunk(b"junk", b"12345", pad=False), SOUND),
    "RF64": wave(wide(len(S16)), chunk(b"fmt ", form()), chunk(b"data", S16, TO_THE_END), kind=b"RF64"),
    "BW64, 24 in 32, more behind it": wave(
        wide(len(S24_IN_32)),
        chunk(b"fmt ", long_form(24, 32)),
        chunk(b"data", S24_IN_32, TO_THE_END),
        chunk(b"axml", bytes(range(1, 200))),
        kind=b"BW64",
    ),
    "Wave64": wave64((b"fmt ", form()), (b"data", S16)),
    "Wave64, 24 in 32": wave64((b"fmt ", long_form(24, 32)), (b"data", S24_IN_32)),
    "AIFC sowt": aifc(b"sowt", 16, S16),
    "AIFC fl32": aifc(b"fl32", 32, TONE.astype(">f4").tobytes()),
    "AIFC of 20 bits": aifc(b"NONE", 20, samples(20, 24, high_first=True)),
}


def read(content: bytes, folder: Path) -> np.ndarray:
    path = folder / "take.wav"
    path.write_bytes(content)
    return read_audio(path).samples


@pytest.mark.parametrize(
    ("valid", "container"),
    [(valid, container) for container in (8, 16, 24, 32) for valid in (8, 12, 16, 20, 24) if valid <= container],
)
def test_fewer_valid_bits_than_the_container(valid: int, container: int, tmp_path: Path) -> None:
    content = wave(chunk(b"fmt ", long_form(valid, container)), chunk(b"data", samples(valid, container)))
    found = read(content, tmp_path)
    assert len(found) == len(TONE)
    np.testing.assert_allclose(found, TONE, atol=2.0 ** (1 - valid))


@pytest.mark.parametrize("name", FORMS)
def test_forms(name: str, tmp_path: Path) -> None:
    found = read(FORMS[name], tmp_path)
    assert len(found) == len(TONE)
    np.testing.assert_allclose(found, TONE, atol=1e-3)


def test_the_logarithmic_form_says_any_number_of_valid_bits(tmp_path: Path) -> None:
    content = bytes(np.arange(len(TONE), dtype=np.uint8))
    plain = read(wave(chunk(b"fmt ", form(8, coding=ULAW)), chunk(b"data", content)), tmp_path)
    for valid in (8, 14, 16):
        found = read(wave(chunk(b"fmt ", long_form(valid, 8, ULAW)), chunk(b"data", content)), tmp_path)
        np.testing.assert_allclose(found, plain)


def test_the_high_byte_first_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="RIFX"):
        read(wave(chunk(b"fmt ", form()), SOUND, kind=b"RIFX"), tmp_path)


@pytest.mark.parametrize("length", [12, 20, 40, 44])
def test_headers_that_end_too_early(length: int, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        read(FORMS["BW64, 24 in 32, more behind it"][:length], tmp_path)
