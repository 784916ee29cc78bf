import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from lipmotion.errors import ExportError
from lipmotion.types import Audio
from lipmotion_faces.video.mp4 import LARGEST_PACKET_BYTES, TAGS, XMP_UUID, append_xmp, frame_rate, write_mp4

RATES = [24, 29.97, 60]


def black(count: int, height: int = 64, width: int = 96) -> list[np.ndarray]:
    return [np.zeros((height, width, 3), dtype=np.uint8) for _ in range(count)]


def silence(duration_s: float, rate_hz: int = 16_000) -> Audio:
    return Audio(np.zeros(round(duration_s * rate_hz), dtype=np.float32), rate_hz)


def pictures(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return time and mean brightness of every frame, as a player shows them."""
    with av.open(str(path)) as container:
        shown = [(frame.time, frame.to_ndarray(format="gray").mean()) for frame in container.decode(video=0)]
    return np.array([s[0] for s in shown]), np.array([s[1] for s in shown])


def sound(path: Path) -> tuple[float, np.ndarray, int]:
    """Return the time of the first sample that is played, the samples, and their rate."""
    with av.open(str(path)) as container:
        frames = list(container.decode(audio=0))
    return float(frames[0].time), np.concatenate([f.to_ndarray()[0] for f in frames]), frames[0].sample_rate


@pytest.mark.parametrize("fps", RATES)
def test_a_click_and_a_flash_stay_together(tmp_path, fps):
    count, flash, rate_hz = int(2 * fps), int(1.3 * fps), 16_000
    frames = black(count)
    frames[flash][:] = 255
    audio = silence(2.0, rate_hz)
    audio.samples[round(flash / fps * rate_hz)] = 1.0
    write_mp4(tmp_path / "a.mp4", frames, fps=fps, audio=audio)

    time_s, brightness = pictures(tmp_path / "a.mp4")
    start_s, samples, played_hz = sound(tmp_path / "a.mp4")
    seen_s = time_s[brightness.argmax()]
    played_s = start_s + np.abs(samples).argmax() / played_hz
    assert seen_s == pytest.approx(flash / fps, abs=2e-4)
    assert played_s == pytest.approx(seen_s, abs=1e-3)


@pytest.mark.parametrize(("fps", "duration_s"), [(24, 1.617), (29.97, 1.0), (60, 1.617)])
def test_streams_start_at_zero_and_keep_their_lengths(tmp_path, fps, duration_s):
    count = int(1.2 * fps)
    write_mp4(tmp_path / "a.mp4", black(count), fps=fps, audio=silence(duration_s, 22_050))
    with av.open(str(tmp_path / "a.mp4")) as container:
        video, sound_stream = container.streams.video[0], container.streams.audio[0]
        assert video.start_time == sound_stream.start_time == 0
        assert (video.codec_context.name, sound_stream.codec_context.name) == ("h264", "aac")
        assert video.codec_context.pix_fmt == "yuv420p"
        assert video.frames == count
        assert video.average_rate == frame_rate(fps)
        assert float(video.duration * video.time_base) == pytest.approx(count / fps, abs=1e-3)
        assert float(sound_stream.duration * sound_stream.time_base) == pytest.approx(duration_s, abs=1e-3)
    time_s, _ = pictures(tmp_path / "a.mp4")
    assert len(time_s) == count
    assert np.diff(time_s) == pytest.approx(np.full(count - 1, 1 / fps), abs=2e-4)


def test_the_end_of_the_sound_is_played(tmp_path):
    audio = silence(1.0)
    audio.samples[-80:] = 0.5
    write_mp4(tmp_path / "a.mp4", black(5), fps=25, audio=audio)
    start_s, samples, rate_hz = sound(tmp_path / "a.mp4")
    loud = np.flatnonzero(np.abs(samples) > 0.2)
    assert start_s + loud[-1] / rate_hz == pytest.approx(1.0, abs=0.005)


def test_sound_lies_beside_its_frames(tmp_path):
    """A player that streams must not wait for the end of the file to play the beginning."""
    write_mp4(tmp_path / "a.mp4", black(300), fps=10, audio=silence(30.0))
    with av.open(str(tmp_path / "a.mp4")) as container:
        packets = [(p.pos, p.stream.type, float(p.dts * p.time_base)) for p in container.demux() if p.dts is not None]
    latest = {"video": 0.0, "audio": 0.0}
    for _, kind, time_s in sorted(packets):
        latest[kind] = time_s
        assert abs(latest["video"] - latest["audio"]) < 1.5


def test_colours_come_back(tmp_path):
    colours = np.zeros((64, 96, 3), dtype=np.uint8)
    colours[:, :32], colours[:, 32:64], colours[:, 64:] = (242, 190, 156), (44, 92, 104), (188, 84, 80)
    write_mp4(tmp_path / "a.mp4", [colours] * 3, fps=25, audio=silence(0.1))
    with av.open(str(tmp_path / "a.mp4")) as container:
        back = next(container.decode(video=0)).to_ndarray(format="rgb24")
    for x in (16, 48, 80):
        assert np.abs(back[32, x].astype(int) - colours[32, x]).max() <= 4


def test_the_frame_rate_is_exact():
    exact = {24: Fraction(24), 25.0: Fraction(25), 12.5: Fraction(25, 2), 23.976: Fraction(24000, 1001)}
    exact |= {29.97: Fraction(30000, 1001), 30000 / 1001: Fraction(30000, 1001), 59.94: Fraction(60000, 1001)}
    assert {fps: frame_rate(fps) for fps in exact} == exact


def test_unusable_frames_are_refused_and_leave_no_file(tmp_path):
    unusable: list[tuple[list[Any], str]] = [
        ([], "no frames"),
        (black(1, 63, 64), "even sizes"),
        (black(1, 64, 63), "even sizes"),
        ([*black(1), *black(1, 32, 32)], "frame 1 .* all alike"),
        ([np.zeros((64, 64), dtype=np.uint8)], "uint8 RGB"),
        ([np.zeros((64, 64, 3))], "float64"),
    ]
    for frames, message in unusable:
        with pytest.raises(ExportError, match=message):
            write_mp4(tmp_path / "a.mp4", frames, fps=25, audio=silence(0.1))
        assert not list(tmp_path.iterdir())


def test_other_unusable_input_is_refused(tmp_path):
    with pytest.raises(ExportError, match="sound has no samples"):
        write_mp4(tmp_path / "a.mp4", black(1), fps=25, audio=silence(0))
    with pytest.raises(ExportError, match="XMP metadata"):
        write_mp4(tmp_path / "a.mp4", black(1), fps=25, audio=silence(0.1), xmp="x" * (LARGEST_PACKET_BYTES + 1))
    for fps in (0, -1, float("nan"), float("inf")):
        with pytest.raises(ExportError, match="frame rate"):
            write_mp4(tmp_path / "a.mp4", black(1), fps=fps, audio=silence(0.1))
    with pytest.raises(ExportError, match="does not exist"):
        write_mp4(tmp_path / "no" / "a.mp4", black(1), fps=25, audio=silence(0.1))


def moving(count: int, height: int = 96, width: int = 128) -> list[np.ndarray]:
    """Return frames of noise that moves, and changes a little from frame to frame."""
    draw = np.random.default_rng(0)
    large = draw.integers(60, 196, (height, width + count, 3))
    return [(large[:, n : n + width] + draw.integers(-4, 5, (height, width, 3))).astype(np.uint8) for n in range(count)]


def test_the_same_frames_give_the_same_bytes(tmp_path):
    for name in ("a.mp4", "b.mp4"):
        write_mp4(tmp_path / name, moving(40), fps=25, audio=silence(1.6), tags={"comment": "c"}, xmp="<x/>")
    content = (tmp_path / "a.mp4").read_bytes()
    assert content == (tmp_path / "b.mp4").read_bytes()
    assert b" bframes=0 " in content
    assert content.index(b"moov") < content.index(b"mdat")


def test_the_bytes_do_not_depend_on_the_number_of_processors(tmp_path):
    """The encoder writes its settings into the video; where the number of threads is its own choice, it varies."""
    write_mp4(tmp_path / "a.mp4", moving(2, 720, 1280), fps=25, audio=silence(0.2))
    assert b" threads=4 " in (tmp_path / "a.mp4").read_bytes()


def test_tags_come_back(tmp_path):
    tags = {name: f"{name}: größe\nline" for name in TAGS} | {"title": "a\udcffb"}
    write_mp4(tmp_path / "a.mp4", black(2), fps=25, audio=silence(0.1), tags=tags)
    with av.open(str(tmp_path / "a.mp4")) as container:
        assert {name: container.metadata.get(name) for name in TAGS} == tags | {"title": r"a\udcffb"}
    content = (tmp_path / "a.mp4").read_bytes()
    assert content.index(b"moov") < content.index("\xa9cmt".encode("latin-1")) < content.index(b"mdat")


def test_a_tag_that_would_be_lost_is_refused(tmp_path):
    with pytest.raises(ExportError, match="unknown tags colour, encoder; known: album"):
        write_mp4(
            tmp_path / "a.mp4", black(1), fps=25, audio=silence(0.1), tags={"encoder": "x", "colour": "y", "title": "z"}
        )
    assert not list(tmp_path.iterdir())


def test_change_from_frame_to_frame_is_kept(tmp_path):
    """An encoder that predicts frames from both sides smooths what changes, and skin looks like wax."""
    y, x = np.mgrid[:96, :128]
    still = np.stack([127 + 60 * np.sin(x / 9), 127 + 60 * np.cos(y / 7), 100 + 0.5 * x], axis=2)
    draw = np.random.default_rng(0)
    frames = [np.rint(still + draw.normal(0, 3, (96, 128, 1))).astype(np.uint8) for _ in range(40)]
    write_mp4(tmp_path / "a.mp4", frames, fps=25, audio=silence(1.6))
    with av.open(str(tmp_path / "a.mp4")) as container:
        shown = [frame.to_ndarray()[:96] for frame in container.decode(video=0)]
    given = [av.VideoFrame.from_ndarray(frame).reformat(format="yuv420p").to_ndarray()[:96] for frame in frames]
    flicker = [np.abs(np.diff(np.array(pictures, float), 2, axis=0)).mean() for pictures in (shown, given)]
    assert 0.4 < flicker[0] / flicker[1] < 1.2


@pytest.fixture
def video(tmp_path):
    """A video without XMP."""
    path = tmp_path / "a.mp4"
    frames = [np.full((32, 48, 3), 9 * n, np.uint8) for n in range(10)]
    write_mp4(path, frames, fps=25, audio=Audio(np.zeros(6400, np.float32), 16_000))
    return path


def brightness(path):
    with av.open(str(path)) as container:
        return [int(frame.to_ndarray(format="gray").mean()) for frame in container.decode(video=0)]


def read_xmp(path):
    with av.open(str(path), options={"export_xmp": "1"}) as container:
        return container.metadata.get("xmp")


def test_what_is_appended_is_read_and_the_video_stays(video):
    before, shown = video.read_bytes(), brightness(video)
    assert read_xmp(video) is None
    append_xmp(video, "<größe/>")
    assert read_xmp(video) == "<größe/>"
    assert video.read_bytes().startswith(before)
    assert brightness(video) == shown


def test_long_boxes_and_other_uuids_are_passed_over(tmp_path):
    path = tmp_path / "a.mp4"
    path.write_bytes(
        struct.pack(">I4sQ", 1, b"mdat", 20) + b"abcd" + struct.pack(">I4s", 26, b"uuid") + bytes(16) + b"no"
    )
    before = path.read_bytes()
    append_xmp(path, "yes")
    assert path.read_bytes() == before + struct.pack(">I4s", 27, b"uuid") + XMP_UUID + b"yes"


def test_what_does_not_end_with_a_whole_box_is_left_alone(tmp_path):
    path = tmp_path / "a.mp4"
    for content in (
        b"",
        b"text",
        struct.pack(">I4s", 0, b"mdat") + b"until the end",
        struct.pack(">I4s", 99, b"mdat") + b"cut short",
        struct.pack(">I4s", 4, b"mdat"),
        struct.pack(">I4s", 8, b"free") + b"abc",
    ):
        path.write_bytes(content)
        with pytest.raises(ExportError, match="not whole boxes"):
            append_xmp(path, "x")
        assert path.read_bytes() == content


def test_packets_that_cannot_be_are_refused(video):
    with pytest.raises(ExportError, match="at most"):
        append_xmp(video, "x" * (LARGEST_PACKET_BYTES + 1))
