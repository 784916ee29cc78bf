import shutil
import struct
from pathlib import Path

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ, read_audio
from speech.sounds import LEVEL, ONSET_S, late_by, tone, write_sound


def onset_s(audio: types.Audio) -> float:
    """Return when the tone begins."""
    return float(np.flatnonzero(np.abs(audio.samples) > LEVEL / 3)[0]) / audio.rate_hz


def test_another_rate_can_be_asked_for(tmp_path: Path) -> None:
    audio = read_audio(write_sound(tmp_path / "a.wav", tone(16_000), 16_000, "pcm_s16le"), 48_000)
    assert (audio.rate_hz, len(audio.samples)) == (48_000, pytest.approx(48_000, abs=100))
    assert onset_s(audio) == pytest.approx(ONSET_S, abs=0.002)


def test_time_0_is_where_the_pictures_begin(tmp_path: Path) -> None:
    for name, start_s in (("a.mp4", 0.0), ("a.mp4", 0.4), ("a.mkv", 0.4), ("a.ts", 0.4)):
        audio = read_audio(write_sound(tmp_path / name, tone(44_100), 44_100, "aac", start_s=start_s, video=True))
        assert onset_s(audio) == pytest.approx(start_s + ONSET_S, abs=0.003)
        assert audio.duration_s == pytest.approx(start_s + 1, abs=0.05)
        assert np.abs(audio.samples[: round((start_s + 0.2) * 16_000)]).max(initial=0) < 0.01


def test_the_content_decides_not_the_name(tmp_path: Path) -> None:
    write_sound(tmp_path / "a.flac", tone(16_000), 16_000, "flac")
    for name in ("sound", "sound.txt", "Ton ü 音.wav"):
        shutil.copy(tmp_path / "a.flac", tmp_path / name)
        assert read_audio(tmp_path / name).duration_s == 1


@pytest.mark.recordings
def test_real_recordings_of_many_kinds(recordings: Path) -> None:
    folder = recordings / "speech-open"
    files = [path for path in sorted(folder.iterdir()) if path.suffix in (".wav", ".flac", ".mp3", ".ogg", ".opus")]
    assert files
    for path in files:
        audio = read_audio(path)
        assert audio.rate_hz == SPEECH_RATE_HZ
        assert 0.001 < np.abs(audio.samples).max() < 2


@pytest.mark.recordings
def test_two_encodings_of_a_real_clip_agree_in_time(recordings: Path) -> None:
    names = ("original/bbal8p.mpg", "clips/bbal8p.mkv")
    one, two = (read_audio(recordings / "grid-s1" / name).samples for name in names)
    assert abs(late_by(one, two)[0]) <= 0.005 * SPEECH_RATE_HZ


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


def riff(*chunks: bytes, kind: bytes = b"RIFF", length: int | None = None) -> bytes:
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
    parts = (b"COMM", common), (b"SSND", bytes(8) + content)
    body = b"AIFC" + b"".join(name + struct.pack(">I", len(part)) + part for name, part in parts)
    return b"FORM" + struct.pack(">I", len(body)) + body


def wide(length: int) -> bytes:
    return chunk(b"ds64", struct.pack("<QQQI", length + 72, length, len(TONE), 0))


S16, S24_IN_32 = samples(16, 16), samples(24, 32)
F32, F64 = TONE.astype("<f4").tobytes(), TONE.astype("<f8").tobytes()
SOUND, TO_THE_END = chunk(b"data", S16), 0xFFFFFFFF
FORMS = {
    "24 in 32 without the longer header": riff(chunk(b"fmt ", form(24, block=4)), chunk(b"data", S24_IN_32)),
    "20 in 24 without it": riff(chunk(b"fmt ", form(20, block=3)), chunk(b"data", samples(20, 24))),
    "12 in 16 without it": riff(chunk(b"fmt ", form(12, block=2)), chunk(b"data", samples(12, 16))),
    "valid bits more than there are": riff(chunk(b"fmt ", long_form(24, 16)), SOUND),
    "valid bits not said": riff(chunk(b"fmt ", long_form(0, 16)), SOUND),
    "the longer header cut off": riff(chunk(b"fmt ", form(16, coding=EXTENSIBLE) + bytes(2)), SOUND),
    **{
        f"float of {8 * len(content) // len(TONE)} bits, {valid} valid": riff(
            chunk(b"fmt ", long_form(valid, 8 * len(content) // len(TONE), FLOAT)), chunk(b"data", content)
        )
        for content, valids in ((F32, (0, 16, 24, 32)), (F64, (0, 24, 32, 64)))
        for valid in valids
    },
    "a length of 0": riff(chunk(b"fmt ", form()), chunk(b"data", S16, 0), length=0),
    "a length to the end": riff(chunk(b"fmt ", form()), chunk(b"data", S16, TO_THE_END), length=TO_THE_END),
    "24 in 32, a length of 0": riff(chunk(b"fmt ", long_form(24, 32)), chunk(b"data", S24_IN_32, 0), length=0),
    "a frame of no bytes": riff(chunk(b"fmt ", form(16, block=0, per_second=32_000)), SOUND),
    "a frame of too many bytes": riff(chunk(b"fmt ", form(16, block=4, per_second=32_000)), SOUND),
    "a padded chunk of odd length": riff(chunk(b"fmt ", form()), chunk(b"junk", b"12345"), SOUND),
    "an odd chunk without its pad": riff(chunk(b"fmt ", form()), chunk(b"junk", b"12345", pad=False), SOUND),
    "RF64": riff(wide(len(S16)), chunk(b"fmt ", form()), chunk(b"data", S16, TO_THE_END), kind=b"RF64"),
    "BW64, 24 in 32, more behind it": riff(
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
    content = riff(chunk(b"fmt ", long_form(valid, container)), chunk(b"data", samples(valid, container)))
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
    plain = read(riff(chunk(b"fmt ", form(8, coding=ULAW)), chunk(b"data", content)), tmp_path)
    for valid in (8, 14, 16):
        found = read(riff(chunk(b"fmt ", long_form(valid, 8, ULAW)), chunk(b"data", content)), tmp_path)
        np.testing.assert_allclose(found, plain)


def test_the_high_byte_first_and_headers_that_end_too_early_are_refused(tmp_path: Path) -> None:
    with pytest.raises(errors.InputError, match="RIFX"):
        read(riff(chunk(b"fmt ", form()), SOUND, kind=b"RIFX"), tmp_path)
    for length in (12, 20, 40, 44):
        with pytest.raises(errors.InputError):
            read(FORMS["BW64, 24 in 32, more behind it"][:length], tmp_path)
