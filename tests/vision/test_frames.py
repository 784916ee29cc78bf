from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.types import Audio
from lipmotion_faces.tracking import frames
from lipmotion_faces.tracking.frames import (
    VideoFrame,
    VideoSpan,
    count_frames,
    find_nominal_rate,
    open_video,
    resample_to_constant_rate,
)
from pipeline.made import write_sound
from vision.variants import write_frames


def all_frames(path: Path) -> list[VideoFrame]:
    with open_video(path) as video:
        return list(video.frames)


def test_every_frame_comes_with_its_time(write_video):
    for ticks in (range(10), [0, 1, 2, 5, 6, 9]):
        with open_video(write_video(ticks=ticks)) as video:
            frames = list(video.frames)
            assert video.stated_rates_hz[0] == 25
        np.testing.assert_allclose([frame.time_s for frame in frames], np.array(ticks) / 25, atol=1e-9)
        np.testing.assert_allclose([frame.image.mean() for frame in frames], 10 * np.arange(len(ticks)), atol=3)
        assert frames[0].image.shape == (48, 64, 3)
        assert frames[0].image.dtype == np.uint8


def test_time_zero_is_the_start_of_the_container(write_video):
    for name in ("clip.ts", "clip.mkv"):
        frames = all_frames(write_video(name, ticks=range(100, 110)))
        np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(10) / 25, atol=1e-3)


@pytest.mark.parametrize("name", ["clip.mp4", "clip.mkv", "clip.ts", "clip.mpg"])
def test_a_span_holds_the_frames_of_its_time(tmp_path, name):
    """With B-frames, and key frames twelve frames apart, wherever seeking ends."""
    pictures = [np.full((48, 64, 3), 30 + n, np.uint8) for n in range(125)]
    codec, options = (
        ("mpeg2video", {"g": "12"}) if name == "clip.mpg" else ("libx264", {"bf": "3", "g": "12", "crf": "1"})
    )
    path = write_frames(tmp_path / name, pictures, codec=codec, options=options)
    with open_video(path) as video:
        whole = [(frame.time_s, frame.image.mean()) for frame in video.frames]
        stated_s = video.stated_s
    for span in (VideoSpan(0.4, 0.8), VideoSpan(3.0, 4.0), VideoSpan(4.48), VideoSpan(0.0, 0.2)):
        expected = [(t, value) for t, value in whole if span.start_s - 1e-4 <= t < span.end_s - 1e-4]
        assert len(expected) >= round((min(span.end_s, 5.0) - span.start_s) * 25) - 1  # MPEG-2's encoder leaves one out
        with open_video(path, span) as video:
            found = [(frame.time_s + span.start_s, frame.image.mean()) for frame in video.frames]
            assert video.stated_s == pytest.approx(min(span.end_s - span.start_s, stated_s - span.start_s))
            assert video.damage == []
        np.testing.assert_allclose(found, expected, atol=1e-4)


class LateContainer:
    """A container of ten pictures, one a second, in which seeking ends three pictures too late, unless at the start."""

    start_time, format = 0, SimpleNamespace(name="late")

    def __init__(self) -> None:
        self.at = 0

    def seek(self, ticks: int, *, stream: object) -> None:
        del stream
        self.at = 0 if ticks <= 0 else ticks + 3

    def demux(self, _stream: object) -> Iterator[SimpleNamespace]:
        for n in range(self.at, 10):
            picture = SimpleNamespace(time=float(n), is_corrupt=n == 1)
            yield SimpleNamespace(decode=lambda shown=picture: [shown])


def test_where_seeking_ends_too_late_all_is_decoded():
    damage: list[str] = []
    found = frames._decode_pictures_from(LateContainer(), SimpleNamespace(time_base=Fraction(1)), 5.0, damage)
    assert [picture.time for picture in found] == [5, 6, 7, 8, 9]
    assert damage == []  # what is damaged before the span is none of its business


def test_a_quick_look_is_small_a_span_behind_the_end_empty_and_pixels_square(write_video):
    with open_video(write_video(size=(64, 48)), longest_px=32) as video:
        frames = list(video.frames)
    assert {frame.image.shape for frame in frames} == {(24, 32, 3)}
    np.testing.assert_allclose([frame.image.mean() for frame in frames], 10 * np.arange(10), atol=3)
    with open_video(write_video(), VideoSpan(5.0, 6.0)) as video:
        assert list(video.frames) == []
        assert video.stated_s == 0
    assert all_frames(write_video(pixel_shape=(3, 2)))[0].image.shape == (48, 96, 3)
    with open_video(write_video()) as video:
        assert next(video.frames).time_s == 0
    with pytest.raises(StopIteration):
        next(video.frames)


def test_rotations_turn_the_corner(write_video):
    pytest.importorskip("cv2")
    picture = np.zeros((48, 64, 3), np.uint8)
    picture[:16, :16] = 255
    for rotation in (90, 180, -90):
        image = all_frames(write_video(picture=picture, rotation=rotation))[0].image
        turned = np.rot90(picture, rotation // 90)
        assert image.shape == turned.shape
        np.testing.assert_allclose(image, turned, atol=60)


def test_pictures_of_an_avi_are_in_order_and_times_that_go_back_are_told(tmp_path):
    for bf in ("0", "3"):
        pictures = [np.full((48, 64, 3), 30 + n, np.uint8) for n in range(50)]
        path = write_frames(tmp_path / f"{bf}.avi", pictures, options={"bf": bf, "crf": "1"})
        np.testing.assert_allclose([frame.time_s for frame in all_frames(path)], np.arange(50) / 25, atol=1e-6)
    path = write_frames(tmp_path / "a.ts", [np.full((48, 64, 3), 9, np.uint8)] * 20, options={"bf": "0"})
    path.write_bytes(2 * path.read_bytes())
    with open_video(path) as video:
        notes = frames.damage_notes(video, np.array([frame.time_s for frame in video.frames]), 25.0)
    assert notes == [f"damaged: 20 of about 39 frames can be used ({frames.GOES_BACK})"]
    with open_video(write_frames(tmp_path / "a.mkv", pictures, ticks=range(100, 150))) as video:
        assert video.stated_s == pytest.approx(2, abs=0.1)  # Matroska states when it ends


def test_sound_alone_is_not_a_video(tmp_path):
    write_sound(tmp_path / "speech.wav", Audio(np.zeros(16_000, np.float32), 16_000))
    with pytest.raises(InputError, match="no video stream"):
        all_frames(tmp_path / "speech.wav")


def test_truncated_later_ends_there_and_before_its_first_picture_is_refused(write_video):
    path = write_video("clip.mkv", ticks=range(100))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    assert 1 <= len(all_frames(path)) < 100
    noise = np.random.default_rng(0).integers(0, 255, (96, 128, 3)).astype(np.uint8)
    path = write_video("clip.mkv", ticks=range(3), picture=noise)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InputError, match=r"picture|not a readable video"):
        all_frames(path)


def test_damaged_packets_are_left_out_and_counted(write_video):
    picture = np.random.default_rng(0).integers(0, 255, (48, 64, 3)).astype(np.uint8)
    path = write_video("clip.avi", ticks=range(100), picture=picture, codec="mjpeg")
    content = bytearray(path.read_bytes())
    starts = [n for n in range(len(content) - 3) if content[n : n + 3] == b"\xff\xd8\xff"]
    for start, end in pairwise(starts[40:51]):
        content[start : end - 16] = bytes(end - 16 - start)
    path.write_bytes(content)
    with open_video(path) as video:
        times_s = [frame.time_s for frame in video.frames]
        assert len(times_s) == 90
        assert len(video.damage) == 10
    np.testing.assert_allclose(times_s, np.delete(np.arange(100), range(40, 50)) / 25, atol=1e-6)


def test_pixels_that_would_fill_the_memory(write_video):
    for shape in ((30, 1), (1, 30)):
        with pytest.raises(InputError, match=r"pictures of \d+ × 48 pixels, required 16 to 8192; scale the video"):
            all_frames(write_video(ticks=[0], size=(320, 48), pixel_shape=shape))


def grey_gif(side: int, pictures: int = 5) -> bytes:
    """Return a moving GIF whose pictures change one pixel of a canvas."""
    picture = b"\x21\xf9\4\0\4\0\0\0,\0\0\0\0\1\0\1\0\0\2\2\x44\1\0"
    size = side.to_bytes(2, "little")
    return b"GIF89a" + size + size + b"\x80\0\0" + b"\0\0\0\xff\xff\xff" + pictures * picture + b";"


def test_a_canvas_that_would_fill_the_memory(tmp_path):
    (tmp_path / "small.gif").write_bytes(grey_gif(64))
    assert len(all_frames(tmp_path / "small.gif")) == 5
    (tmp_path / "large.gif").write_bytes(grey_gif(16_000))
    with pytest.raises(InputError, match=r"large\.gif: pictures of no size, or of more than 9437184 pixels; scale"):
        all_frames(tmp_path / "large.gif")


def test_pictures_larger_than_stated_are_not_decoded(tmp_path):
    import io

    from PIL import Image

    packets = []
    for side in (64, 3200):
        stream = io.BytesIO()
        Image.new("L", (side, side)).save(stream, "PNG")
        packets += [stream.getvalue()] * 5
    with av.open(str(tmp_path / "a.mov"), "w") as container:
        stream = container.add_stream("png", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "gray"
        for number, content in enumerate(packets):
            packet = av.Packet(content)
            packet.stream, packet.pts, packet.dts, packet.time_base = stream, number, number, Fraction(1, 25)
            container.mux(packet)
    with open_video(tmp_path / "a.mov") as video:
        assert [frame.image.shape for frame in video.frames] == [(64, 64, 3)] * 5
        assert len(video.damage) == 5


@pytest.mark.parametrize(("name", "subtitles"), [("a.mkv", "subrip"), ("a.mp4", "mov_text")])
def test_subtitles_that_go_on_after_the_pictures(tmp_path, name, subtitles):
    with av.open(str(tmp_path / name), "w") as container:
        stream, words = container.add_stream("libx264", rate=25), container.add_mux_stream(subtitles)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(25):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 100, np.uint8), format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
        packet = av.Packet(b"words that stay")
        packet.stream, packet.pts, packet.dts, packet.duration = words, 500, 500, 9000
        packet.time_base = Fraction(1, 1000)
        container.mux(packet)
    with open_video(tmp_path / name) as video:
        assert len(list(video.frames)) == 25
        assert video.stated_s == pytest.approx(1, abs=0.05)


def test_a_cover_before_the_video_is_not_the_video(tmp_path, write_video):
    with av.open(str(write_video())) as source, av.open(str(tmp_path / "a.mp4"), "w") as container:
        cover = container.add_stream("mjpeg", rate=1)
        cover.width = cover.height = 304
        cover.pix_fmt, cover.disposition = "yuvj420p", av.stream.Disposition.attached_pic
        copied = container.add_stream_from_template(source.streams.video[0], opaque=True)
        picture = av.VideoFrame.from_ndarray(np.full((304, 304, 3), 90, np.uint8), format="rgb24")
        container.mux([*cover.encode(picture), *cover.encode(None)])
        for packet in source.demux():
            if packet.size:
                packet.stream = copied
                container.mux(packet)
    frames = all_frames(tmp_path / "a.mp4")
    assert [frame.image.shape for frame in frames] == [(48, 64, 3)] * 10


def test_the_stated_rate_is_believed_when_it_fits():
    rounded = np.round(np.arange(90) / 30, 3)  # 33, 33, 34 ms
    assert find_nominal_rate(rounded, [30.0]) == 30.0
    assert find_nominal_rate(np.delete(rounded, [4, 30, 31]), [30.0, 29.1]) == 30.0
    assert find_nominal_rate(np.arange(50) / 25, [1000.0]) == pytest.approx(25)
    assert find_nominal_rate(np.arange(50) / 25, [1000.0, 24.9]) == 24.9
    assert find_nominal_rate(np.arange(50) / 25, []) == pytest.approx(25)
    assert [find_nominal_rate(np.zeros(1), stated) for stated in ([50.0], [])] == [50.0, 25.0]  # of one frame
    assert count_frames(np.arange(75) / 25, 25.0) == 75
    assert count_frames(np.array([0, 0.033, 0.067, 2.967]), 30.0) == 90


def test_dropped_frames_are_found_again_by_their_time():
    times_s = np.arange(100) / 25
    curve = np.stack([np.sin(2 * np.pi * 1.5 * times_s), np.cos(2 * np.pi * times_s)], axis=1)
    kept = np.delete(np.arange(100), [7, 30, 31, 60, 80])
    result = resample_to_constant_rate(times_s[kept], curve[kept], 25.0, 100)
    np.testing.assert_array_equal(result[kept], curve[kept])
    np.testing.assert_allclose(result, curve, atol=0.02)


def test_long_gaps_are_straight_and_ends_constant():
    values = np.random.default_rng(4).normal(size=(60, 2))
    kept = np.r_[5:20, 40:55]
    result = resample_to_constant_rate(kept / 25, values[kept], 25.0, 60)
    np.testing.assert_array_equal(result[:5], np.tile(values[5], (5, 1)))
    np.testing.assert_array_equal(result[55:], np.tile(values[54], (5, 1)))
    np.testing.assert_allclose(np.diff(result[19:41], n=2, axis=0), 0, atol=1e-12)
