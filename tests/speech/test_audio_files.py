import json
import os
import shutil
import struct
import sys
from itertools import product
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from children import run_child
from lipmotion import errors, types
from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import _TrackDecoder, read_audio
from speech.sounds import (
    LEVEL,
    ONSET_S,
    babble,
    late_by,
    opened_in,
    tone,
    write_constant_flac,
    write_sound,
    write_stamped,
    write_wave,
)


def onset_s(audio: types.Audio) -> float:
    """Return when the tone begins."""
    return float(np.flatnonzero(np.abs(audio.samples) > LEVEL / 3)[0]) / audio.rate_hz


def test_time_0_is_where_the_pictures_begin(tmp_path: Path) -> None:
    for name, start_s in (("a.mp4", 0.0), ("a.mp4", 0.4), ("a.mkv", 0.4), ("a.ts", 0.4)):
        audio = read_audio(write_sound(tmp_path / name, tone(44_100), 44_100, "aac", start_s=start_s, video=True))
        assert onset_s(audio) == pytest.approx(start_s + ONSET_S, abs=0.003)
        assert audio.duration_s == pytest.approx(start_s + 1, abs=0.05)
        assert np.abs(audio.samples[: round((start_s + 0.2) * 16_000)]).max(initial=0) < 0.01


def test_another_rate_can_be_asked_for(tmp_path: Path) -> None:
    audio = read_audio(write_sound(tmp_path / "a.flac", tone(16_000), 16_000, "flac"), 48_000)
    assert (audio.rate_hz, len(audio.samples)) == (48_000, pytest.approx(48_000, abs=100))
    assert onset_s(audio) == pytest.approx(ONSET_S, abs=0.002)


def test_the_content_decides_not_the_name(tmp_path: Path) -> None:
    write_sound(tmp_path / "a.flac", tone(16_000), 16_000, "flac")
    for name in ("sound", "sound.txt", "Ton ü 音.wav"):
        shutil.copy(tmp_path / "a.flac", tmp_path / name)
        assert read_audio(tmp_path / name).duration_s == 1


RATE_HZ = 16_000
TONE = 0.4 * np.sin(2 * np.pi * 300 * np.arange(RATE_HZ // 4) / RATE_HZ)
PCM, FLOAT, ULAW, EXTENSIBLE = 1, 3, 7, 0xFFFE
GUID = bytes.fromhex("000000001000800000aa00389b71")
WAVE64 = bytes.fromhex("f3acd3118cd100c04f8edb8a")


def samples(valid: int, container: int) -> bytes:
    """Samples of so many bits, at the left of containers of so many, with zeros behind them."""
    whole = np.round(TONE * 2.0 ** (valid - 1)).astype(np.int64) << (container - valid)
    if container == 8:
        return (whole + 128).astype(np.uint8).tobytes()
    return whole.astype("<i8").view(np.uint8).reshape(-1, 8)[:, : container // 8].tobytes()


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
    **{f"float of {bits}, {valid} valid": riff(chunk(b"fmt ", long_form(valid, bits, FLOAT)), chunk(b"data", content))
       for content, bits, valids in ((F32, 32, (0, 16, 24, 32)), (F64, 64, (0, 24, 32, 64))) for valid in valids},
    "a length of 0": riff(chunk(b"fmt ", form()), chunk(b"data", S16, 0), length=0),
    "a length to the end": riff(chunk(b"fmt ", form()), chunk(b"data", S16, TO_THE_END), length=TO_THE_END),
    "24 in 32, a length of 0": riff(chunk(b"fmt ", long_form(24, 32)), chunk(b"data", S24_IN_32, 0), length=0),
    "a frame of no bytes": riff(chunk(b"fmt ", form(16, block=0, per_second=32_000)), SOUND),
    "a frame of too many bytes": riff(chunk(b"fmt ", form(16, block=4, per_second=32_000)), SOUND),
    "frames of two samples": riff(chunk(b"fmt ", form(16, block=4)), SOUND),
    "frames of too many bytes of 24": riff(chunk(b"fmt ", form(24, block=4)), chunk(b"data", samples(24, 24))),
    "a padded chunk of odd length": riff(chunk(b"fmt ", form()), chunk(b"_PMX", b"12345"), SOUND),
    "an odd chunk without its pad": riff(chunk(b"fmt ", form()), chunk(b"junk", b"12345", pad=False), SOUND),
    "RF64": riff(wide(len(S16)), chunk(b"fmt ", form()), chunk(b"data", S16, TO_THE_END), kind=b"RF64"),
    "BW64, 24 in 32, more behind it": riff(wide(len(S24_IN_32)), chunk(b"fmt ", long_form(24, 32)), chunk(
        b"data", S24_IN_32, TO_THE_END), chunk(b"axml", bytes(range(1, 200))), kind=b"BW64"),
    "RF64, unfinished": riff(wide(0), chunk(b"fmt ", form()), chunk(b"data", S16, TO_THE_END), kind=b"RF64"),
    "two pieces": riff(chunk(b"fmt ", form()), chunk(b"data", S16[:2000]), chunk(b"cue ", b"1"), chunk(
        b"data", S16[2000:])),
    "two files": riff(chunk(b"fmt ", form()), chunk(b"data", S16[:2000])) + riff(
        chunk(b"fmt ", form()), chunk(b"data", S16[2000:])),
    "Wave64": wave64((b"fmt ", form()), (b"data", S16)),
    "two files of Wave64": wave64((b"fmt ", form()), (b"data", S16[:2000])) + wave64(
        (b"fmt ", form()), (b"data", S16[2000:])),
    "Wave64, 24 in 32": wave64((b"fmt ", long_form(24, 32)), (b"data", S24_IN_32)),
}  # fmt: skip


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
def test_forms(name: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = read(FORMS[name], tmp_path)
    assert "cut short" not in caplog.text
    assert len(found) == len(TONE)
    np.testing.assert_allclose(found, TONE, atol=1e-3)


def test_what_is_missing_of_other_files_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for name, codec, said in (
        ("a.flac", "flac", "; the last"),
        ("a.caf", "pcm_s16le", "; the last"),
        ("a.opus", "libopus", "its last page is not marked"),
    ):
        path = write_sound(tmp_path / name, babble(16_000, 12), 16_000, codec)
        for share in (1, 0.93):
            caplog.clear()
            path.write_bytes(path.read_bytes()[: round(share * path.stat().st_size)])
            read_audio(path)
            assert ("cut short" in caplog.text, said in caplog.text) == (share < 1, share < 1)
    caplog.clear()  # a length that FFmpeg guesses is none that the file states
    read_audio(write_sound(tmp_path / "a.aac", np.pad(babble(16_000, 2), ((0, 0), (160_000, 0))), 16_000, "aac"))
    read_audio(write_sound(tmp_path / "a.asf", babble(44_100, 0.5), 44_100, "mp2", video=True))
    assert not caplog.text


def test_what_is_missing_of_a_wave_file_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Not of a stream, whose size is the largest that its program takes; not a few samples, which nobody misses."""
    for header, content in ((long_form(16, 16), S16), (long_form(24, 32), S24_IN_32), (form(per_second=1), S16)):
        for size in (len(content) + 1000, 0x7FFF0024, 3 * len(content)):
            read(riff(chunk(b"fmt ", header), chunk(b"data", content, size)), tmp_path)
    said = "cut short: it states 0.8 s of sound and holds 0.2 s; the last 0.5 s are missing"
    assert [message.partition(": ")[2] for message in caplog.messages] == [said] * 3


def test_sound_that_the_header_does_not_name_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    read(riff(chunk(b"fmt ", form()), chunk(b"data", S16, len(S16) // 2)), tmp_path)
    assert "its header states 0.1 s of sound, and more bytes follow" in caplog.text
    caplog.clear()
    for behind in (bytes(len(S16)), chunk(b"LIST", S16), riff(chunk(b"fmt ", form(8)), chunk(b"data", S16))):
        read(riff(chunk(b"fmt ", form()), SOUND) + behind, tmp_path)
    assert caplog.text.count("more bytes follow") == 1


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


Samples = NDArray[np.float32]
MS = 16  # samples a millisecond

EXACT = [
    # suffix, codec: no delay, no padding, nothing lost but bits
    *[("wav", f"pcm_{form}") for form in ("u8", "s16le", "s24le", "s32le", "f32le", "f64le", "alaw", "mulaw")],
    *[("aiff", "pcm_s16be"), ("aiff", "pcm_s24be"), ("au", "pcm_s16be"), ("caf", "pcm_s16le"), ("w64", "pcm_s16le")],
    *[("avi", "pcm_s16le"), ("mkv", "pcm_s16le"), ("mov", "pcm_s16le"), ("flac", "flac"), ("ogg", "flac")],
    *[("mkv", "flac"), ("m4a", "alac"), ("wv", "wavpack"), ("tta", "tta")],
]
CODED = [
    # suffix, codec, samples that a whole last frame may add, samples of delay that the container does not record
    *((suffix, "libmp3lame", 0, 0) for suffix in ("mp3", "mkv")),
    *((suffix, "libopus", 0, 0) for suffix in ("ogg", "opus", "webm", "mkv")),
    *((suffix, "vorbis", 2048, 0) for suffix in ("ogg", "webm")),
    *((suffix, "aac", 1024, 0) for suffix in ("mp4", "m4a", "mov", "mkv")),
    *[("mkv", "ac3", 1536, 0), ("wav", "adpcm_ima_wav", 2048, 0)],
    *[("aac", "aac", 1024, 0), ("avi", "libmp3lame", 1152, 0), ("mp2", "mp2", 1152, 0), ("ac3", "ac3", 1536, 0)],
    *[("wav", "libmp3lame", 1152, 0), ("ts", "aac", 2048, 1024), ("flv", "aac", 2048, 1024), ("mpg", "mp2", 1152, 480)],
    *[("ts", "mp2", 1152, 480), ("mpg", "ac3", 1536, 256)],
]
OPTIONS = {"vorbis": {"strict": "experimental"}}


@pytest.fixture(scope="module")
def original() -> Samples:
    return babble(16_000)[0]


@pytest.mark.parametrize("kinds", [EXACT[1::7], pytest.param(EXACT, marks=pytest.mark.long)])
def test_uncompressed_and_lossless(tmp_path: Path, original: Samples, kinds: list[tuple[str, str]]) -> None:
    rates = (44_100,) if kinds is not EXACT else (8000, 11_025, 16_000, 44_100, 384_000)
    for rate_hz in rates:
        for suffix, codec in kinds if rate_hz in (16_000, 44_100) else EXACT[1:2]:
            audio = read_audio(write_sound(tmp_path / f"a.{suffix}", babble(rate_hz), rate_hz, codec))
            shift, alike = late_by(audio.samples, original)
            assert (shift, abs(audio.duration_s - 2) < 1e-3) == (0, True), (suffix, codec, rate_hz)
            assert alike > 0.999


@pytest.mark.parametrize("kinds", [CODED[:1] + CODED[3:4] + CODED[14:15], pytest.param(CODED, marks=pytest.mark.long)])
def test_coded(tmp_path: Path, original: Samples, kinds: list[tuple[str, str, int, int]]) -> None:
    """No delay where the container records it; elsewhere the codec's own, no more."""
    for suffix, codec, padding, delay in kinds:
        sound = babble(48_000) if codec != "vorbis" else np.tile(babble(48_000), (2, 1))
        audio = read_audio(write_sound(tmp_path / f"a.{suffix}", sound, 48_000, codec, options=OPTIONS.get(codec)))
        shift, alike = late_by(audio.samples, original)
        assert shift == pytest.approx(delay / 3, abs=MS), (suffix, codec)
        assert -0.001 < audio.duration_s - 2 < padding / 48_000 + 0.001
        assert alike > 0.95  # a delay of a third of a sample may be left in it


def test_more_channels_than_have_a_name(tmp_path: Path, original: Samples) -> None:
    path = write_wave(tmp_path / "a.wav", np.round(np.tile(original[:, None], 12) * 32767).astype(np.int16))
    assert late_by(read_audio(path).samples, original)[1] > 0.999


def test_the_cover_of_an_album_changes_nothing(tmp_path: Path) -> None:
    plain = read_audio(write_sound(tmp_path / "a.mp3", babble(44_100), 44_100, "libmp3lame"))
    covered = read_audio(write_sound(tmp_path / "b.mp3", babble(44_100), 44_100, "libmp3lame", cover=True))
    assert np.array_equal(plain.samples, covered.samples)


@pytest.mark.parametrize("tag", [b"ID3\3\0\0\0\1\x1a\0" + bytes(range(256)) * 106, b"APETAGEX" + bytes(24)])
def test_tags_between_files_that_are_joined_are_no_damage(tmp_path: Path, caplog, tag) -> None:
    path = write_sound(tmp_path / "a.mp3", babble(44_100), 44_100, "libmp3lame")
    one, content = read_audio(path), path.read_bytes()[44:]  # behind the tag of its own
    path.write_bytes(content + tag + content)
    joined = read_audio(path).samples
    assert caplog.text == ""
    assert abs(late_by(joined[len(joined) // 2 :], one.samples)[0]) < 50 * MS


@pytest.mark.parametrize(
    "kind", "wav:adpcm_ms wav:pcm_alaw aiff:pcm_s16be caf:pcm_s16le m4a:aac flv:aac tta:tta".split()
)
def test_files_that_are_joined_are_read_or_said(tmp_path: Path, caplog, kind: str) -> None:
    suffix, codec = kind.split(":")
    path = write_sound(tmp_path / f"a.{suffix}", babble(44_100), 44_100, codec)
    one_s = read_audio(path).duration_s
    path.write_bytes(2 * path.read_bytes())
    assert read_audio(path).duration_s == pytest.approx(one_s * (2 if suffix == "wav" else 1), abs=0.03)
    assert ("2 pieces, which are joined" if suffix == "wav" else "joined to its end") in caplog.text


def test_the_first_of_several_tracks(tmp_path: Path, original: Samples) -> None:
    with av.open(str(tmp_path / "a.mka"), "w") as container:
        streams = [container.add_stream("pcm_s16le", rate=16_000, layout="mono") for _ in range(2)]
        for stream, sound in zip(streams, (original, 0.5 * original[::-1]), strict=True):
            pcm = (sound * 32767).astype(np.int16)[None]
            frame = av.AudioFrame.from_ndarray(pcm, format="s16", layout="mono")
            frame.rate, frame.pts = 16_000, 0
            for packet in [*stream.encode(frame), *stream.encode()]:
                container.mux(packet)
    assert late_by(read_audio(tmp_path / "a.mka").samples, original)[1] > 0.999


def test_channels_that_cancel(tmp_path: Path, original: Samples, caplog: pytest.LogCaptureFixture) -> None:
    several = (((0.8, -1), 1), ((0, 0, 0, 0, 1, 0), None), ((1, 0), None), ((1, -0.3), None))
    for constant, (weights, loudest) in product((0.0, 0.3), several):
        caplog.clear()
        sound = np.array(weights, np.float32)[:, None] * original + np.float32(constant)
        audio = read_audio(write_sound(tmp_path / "a.wav", sound, 16_000, "pcm_f32le"))
        wanted = sound.mean(axis=0) if loudest is None else sound[loudest]
        assert np.allclose(audio.samples, wanted, atol=1e-6)
        said = f"a.wav: its {len(weights)} channels cancel one another in their mean; channel {(loudest or 0) + 1}"
        assert (said in caplog.text) == (loudest is not None)


NAMES = ["-o.wav", "a b.wav", 'it\'s "it".wav', "new\nline.wav", "😀 音 é.wav", "12:30.wav", "http:x.wav", "%03d?*.wav"]


@pytest.mark.skipif(os.name == "nt", reason="such names cannot be given there")
def test_any_name_is_a_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = write_sound(tmp_path / "plain.wav", babble(16_000), 16_000, "pcm_s16le")
    for name in (*NAMES, os.fsdecode(b"\xff\xfe.wav")):
        path = path.rename(tmp_path / name)
        assert read_audio(Path(name)).duration_s == 2


FOREIGN = json.loads(Path(__file__).with_name("foreign_files.json").read_text(encoding="utf-8"))
"""Files by name, and what they say; each names its neighbour, a good recording."""


@pytest.mark.skipif(sys.platform != "linux", reason="what is opened is asked of Linux")
def test_nothing_but_the_file_itself_is_opened(tmp_path: Path) -> None:
    write_sound(tmp_path / "a.mpg", babble(48_000, 0.5), 48_000, "mp2", video=True).rename(tmp_path / "neighbour.sub")
    Image.new("RGB", (64, 48)).save(tmp_path / "page001.png")
    for name, text in FOREIGN.items():
        (tmp_path / name).write_text(text)
        with opened_in(tmp_path) as opened, pytest.raises(InputError, match=r"required a recording|not a readable"):
            read_audio(tmp_path / name)
        assert opened <= {name}


@pytest.mark.skipif(sys.platform != "linux", reason="what is opened is asked of Linux")
def test_sound_that_an_mp4_says_is_in_another_file_is_not_sought_there(tmp_path: Path) -> None:
    write_sound(tmp_path / "b.mov", babble(48_000), 48_000, "aac")
    content = write_sound(tmp_path / "a.mov", babble(48_000), 48_000, "aac").read_bytes()
    (tmp_path / "a.mov").write_bytes(referring(content, b"b.mov"))
    with opened_in(tmp_path) as opened, pytest.raises(InputError, match="holds 0 ms of sound"):
        read_audio(tmp_path / "a.mov")
    assert opened == {"a.mov"}
    with opened_in(tmp_path) as opened, av.open(str(tmp_path / "a.mov"), options={"enable_drefs": "1"}):
        pass
    assert opened == {"a.mov", "b.mov"}


def referring(content: bytes, name: bytes) -> bytes:
    """Return a QuickTime file, its index at the end, whose sound is said to lie in the file of this name."""
    path = b"/" + name
    alias = bytes(10) + (27).to_bytes(1) + bytes(39) + len(name).to_bytes(1) + name.ljust(63, b"\0") + bytes(16)
    alias += (1).to_bytes(2) + (1).to_bytes(2) + bytes(16) + (2).to_bytes(2) + len(path).to_bytes(2) + path
    alias += bytes(len(path) % 2) + b"\xff\xff\0\0"
    entry = (12 + len(alias)).to_bytes(4) + b"alis" + bytes(4) + alias
    start = content.index(b"dref") + 12
    old = int.from_bytes(content[start : start + 4])
    grown = bytearray(content[:start] + entry + content[start + old :])
    for kind in (b"moov", b"trak", b"mdia", b"minf", b"dinf", b"dref"):
        place = content.rindex(kind, 0, start) - 4
        size = int.from_bytes(content[place : place + 4]) + len(entry) - old
        grown[place : place + 4] = size.to_bytes(4)
    return bytes(grown)


def test_a_hole_keeps_what_follows_in_time(tmp_path: Path, original: Samples, caplog: pytest.LogCaptureFixture) -> None:
    for suffix, codec in (("mkv", "pcm_s16le"), ("mp4", "aac")):
        caplog.clear()
        path = write_sound(tmp_path / f"a.{suffix}", babble(48_000), 48_000, codec, hole_s=(0.7, 1.1))
        audio = read_audio(path)
        after = slice(round(1.2 * 16_000), None)
        assert abs(late_by(audio.samples[after], original[after])[0]) <= 2 * MS
        assert np.abs(audio.samples[round(0.76 * 16_000) : round(1.04 * 16_000)]).max() < 0.01
        assert "damaged: 0 of" in caplog.text
        assert "became silence" in caplog.text


def test_damaged_packets_are_left_out_and_reported(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    content = bytearray(write_sound(tmp_path / "a.flac", babble(16_000, 10.0), 16_000, "flac").read_bytes())
    middle = len(content) // 2
    content[middle : middle + 9000] = np.random.default_rng(0).bytes(9000)
    (tmp_path / "a.flac").write_bytes(content)
    audio = read_audio(tmp_path / "a.flac")
    assert 8 < audio.duration_s < 10.5
    (text,) = caplog.messages
    assert "a.flac: damaged: " in text
    assert "holes of 0.00 s" not in text
    assert text.endswith("cannot be decoded") == ("holes of" not in text)
    read_audio(tmp_path / "a.flac", 48_000, warn=False)  # once more, for the sound of a video
    assert len(caplog.messages) == 1


def test_time_stamps_that_jump_far_do_not_fill_the_memory(tmp_path: Path) -> None:
    path = write_sound(tmp_path / "a.mkv", babble(48_000), 48_000, "flac", start_s=90_000, video=True)
    with pytest.raises(InputError, match=r"a\.mkv: the time stamps of its sound jump by 90000 s"):
        read_audio(path)


PEAK = """
import sys
from pathlib import Path
from lipmotion.speech.sound.audio_files import read_audio
read_audio(Path(sys.argv[1]))
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(int(peak.split()[1]) // 1024)  # getrusage counts what the process was before it became this one
"""

STAMPS_S = {
    # many holes that are each allowed
    "rising": [599.0 * n for n in range(150)],
    "to and fro after good ones": [n / 50 if n < 100 else 10 + 500.0 * (n % 2) for n in range(500)],
}


@pytest.mark.parametrize("name", STAMPS_S)
def test_holes_are_bounded_all_together(tmp_path: Path, name: str) -> None:
    said = r"a\.mkv: the time stamps of its sound leave holes of \d+ s beside \d+\.0 s of sound"
    with pytest.raises(InputError, match=said):
        read_audio(write_stamped(tmp_path / "a.mkv", STAMPS_S[name]))


def test_speech_with_long_pauses_is_taken_as_it_is(tmp_path: Path) -> None:
    """A frame every 0.4 s, as codecs send them while nobody speaks, and ten minutes of nothing."""
    stamps_s = [*(0.4 * n for n in range(250)), *(690 + 0.4 * n for n in range(250))]
    audio = read_audio(write_stamped(tmp_path / "a.mkv", stamps_s))
    assert audio.duration_s == pytest.approx(stamps_s[-1] + 0.02, abs=0.001)
    for stamp_s in (0.4, 40, 99.6, 690, 750.4):
        first = round(stamp_s * 16_000)
        assert np.abs(audio.samples[first : first + 320]).max() > 0.5
        assert np.abs(audio.samples[first + 640 : first + 6000]).max() == 0


def test_sound_out_of_nothing_is_refused(tmp_path: Path) -> None:
    said = r"a\.flac: \d+ bytes of sound last \d+ s, required at most \d+ s \(20 bytes a second\)"
    with pytest.raises(InputError, match=said):
        read_audio(write_constant_flac(tmp_path / "a.flac", 80_000))


def test_sound_after_digital_silence_and_after_a_long_sound_is_in_its_place(tmp_path: Path) -> None:
    whole = np.random.default_rng(0).uniform(-0.5, 0.5, (1, 30 * 16_000)).astype(np.float32)
    for first_s, end_s in ((0, 1), (2.1, 2.2), (20, 29)):
        whole[:, round(first_s * 16_000) : round(end_s * 16_000)] = 0
    path = write_sound(tmp_path / "a.wav", whole, 16_000, "pcm_f32le")
    assert np.array_equal(read_audio(path).samples, whole[0])


def test_minutes_of_digital_silence_are_no_crime_but_each_rate_is_checked(tmp_path: Path) -> None:
    assert read_audio(write_constant_flac(tmp_path / "a.flac", 60)).duration_s == pytest.approx(60, abs=8)
    path = write_constant_flac(tmp_path / "a.flac", 60, rates_hz=(8000, 1))
    with pytest.raises(InputError, match=r"a\.flac: sampled at 1 Hz, required 4000 to 1000000; export the recording"):
        read_audio(path)


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted as Linux does")
def test_memory_is_that_of_the_result(tmp_path: Path) -> None:
    sounds = [np.tile(babble(16_000, 20), (1, count)) for count in (1, 60, 60)]
    sounds[2][:, 16_000:] = 0
    paths = [write_sound(tmp_path / f"{n}.wav", sound, 16_000, "pcm_f32le") for n, sound in enumerate(sounds)]
    some, much, silent = (int(run_child([sys.executable, "-c", PEAK, path], check=True).stdout) for path in paths)
    sound_mb = sounds[1].nbytes >> 20
    assert 0.9 * sound_mb < much - some < 1.3 * sound_mb
    assert silent - some < 0.3 * sound_mb


def test_sound_and_silence_are_bounded_together() -> None:
    """30 s of sound and 620 s of holes are each short enough for 810 bytes; their sum is not."""
    decoder = object.__new__(_TrackDecoder)
    decoder._name, decoder._size, decoder._sound_s, decoder.silence_s = "a.mkv", 810_000, 30.0, 620.0
    decoder._check_silence()
    decoder._size = 810
    with pytest.raises(InputError, match="810 bytes of sound last 650 s"):
        decoder._check_silence()
