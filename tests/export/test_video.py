import re
import struct
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from lipmotion import errors, types
from lipmotion.pipeline.batch.report import SHARED_COLOURS, insert_colours
from lipmotion_faces.film.filmed_video import HEIGHT_SHARE, MARGIN_SHARE, WHITE, WIDTH_SHARE, add_inset, place_inset
from lipmotion_faces.video import mp4, synthetic_mark
from lipmotion_lab.report.html import Html, build_page, element, joined


def black(count: int, height: int = 64, width: int = 96) -> list[np.ndarray]:
    return [np.zeros((height, width, 3), dtype=np.uint8) for _ in range(count)]


def silence(duration_s: float, rate_hz: int = 16_000) -> types.Audio:
    return types.Audio(np.zeros(round(duration_s * rate_hz), dtype=np.float32), rate_hz)


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


@pytest.mark.parametrize("fps", [24, 29.97, 60])
def test_a_click_and_a_flash_stay_together(tmp_path, fps):
    count, flash, rate_hz = int(2 * fps), int(1.3 * fps), 16_000
    frames = black(count)
    frames[flash][:] = 255
    audio = silence(2.0, rate_hz)
    audio.samples[round(flash / fps * rate_hz)] = 1.0
    mp4.write_mp4(tmp_path / "a.mp4", frames, fps=fps, audio=audio)

    time_s, brightness = pictures(tmp_path / "a.mp4")
    start_s, samples, played_hz = sound(tmp_path / "a.mp4")
    seen_s = time_s[brightness.argmax()]
    played_s = start_s + np.abs(samples).argmax() / played_hz
    assert seen_s == pytest.approx(flash / fps, abs=2e-4)
    assert played_s == pytest.approx(seen_s, abs=1e-3)


@pytest.mark.parametrize(("fps", "duration_s"), [(24, 1.617), (29.97, 1.0), (60, 1.617)])
def test_streams_start_at_zero_and_keep_their_lengths(tmp_path, fps, duration_s):
    count = int(1.2 * fps)
    mp4.write_mp4(tmp_path / "a.mp4", black(count), fps=fps, audio=silence(duration_s, 22_050))
    with av.open(str(tmp_path / "a.mp4")) as container:
        video, sound_stream = container.streams.video[0], container.streams.audio[0]
        assert video.start_time == sound_stream.start_time == 0
        assert (video.codec_context.name, sound_stream.codec_context.name) == ("h264", "aac")
        assert video.codec_context.pix_fmt == "yuv420p"
        assert video.frames == count
        assert video.average_rate == mp4.find_frame_rate(fps)
        assert float(video.duration * video.time_base) == pytest.approx(count / fps, abs=1e-3)
        assert float(sound_stream.duration * sound_stream.time_base) == pytest.approx(duration_s, abs=1e-3)
    time_s, _ = pictures(tmp_path / "a.mp4")
    assert len(time_s) == count
    assert np.diff(time_s) == pytest.approx(np.full(count - 1, 1 / fps), abs=2e-4)


def test_the_end_of_the_sound_is_played(tmp_path):
    audio = silence(1.0)
    audio.samples[-80:] = 0.5
    mp4.write_mp4(tmp_path / "a.mp4", black(5), fps=25, audio=audio)
    start_s, samples, rate_hz = sound(tmp_path / "a.mp4")
    loud = np.flatnonzero(np.abs(samples) > 0.2)
    assert start_s + loud[-1] / rate_hz == pytest.approx(1.0, abs=0.005)


def test_sound_lies_beside_its_frames(tmp_path):
    """A player that streams must not wait for the end of the file to play the beginning."""
    mp4.write_mp4(tmp_path / "a.mp4", black(300), fps=10, audio=silence(30.0))
    with av.open(str(tmp_path / "a.mp4")) as container:
        packets = [(p.pos, p.stream.type, float(p.dts * p.time_base)) for p in container.demux() if p.dts is not None]
    latest = {"video": 0.0, "audio": 0.0}
    for _, kind, time_s in sorted(packets):
        latest[kind] = time_s
        assert abs(latest["video"] - latest["audio"]) < 1.5


def test_the_frame_rate_is_exact():
    exact = {24: Fraction(24), 25.0: Fraction(25), 12.5: Fraction(25, 2), 23.976: Fraction(24000, 1001)}
    exact |= {29.97: Fraction(30000, 1001), 30000 / 1001: Fraction(30000, 1001), 59.94: Fraction(60000, 1001)}
    assert {fps: mp4.find_frame_rate(fps) for fps in exact} == exact


@pytest.mark.parametrize("write", [mp4.write_mp4, mp4.write_with_alpha])
def test_unusable_frames_are_refused_and_leave_no_file(tmp_path, write):
    unusable: list[tuple[list[Any], str]] = [
        ([], "no frames"),
        (black(1, 63, 64), "even sizes"),
        (black(1, 64, 63), "even sizes"),
        ([*black(1), *black(1, 32, 32)], "frame 1"),
        ([np.zeros((64, 64), dtype=np.uint8)], "uint8 RGB"),
        ([np.zeros((64, 64, 3))], "float64"),
    ]
    path = tmp_path / ("a.mp4" if write is mp4.write_mp4 else "a.webm")
    for frames, message in unusable:
        with pytest.raises(errors.ExportError, match=message):
            write(path, frames, fps=25, audio=silence(0.1))
    for fps in (0, -1, float("nan"), float("inf")):
        with pytest.raises(errors.ExportError, match="frame rate"):
            write(path, black(1), fps=fps, audio=silence(0.1))
    with pytest.raises(errors.ExportError, match="no samples"):
        write(path, black(1), fps=25, audio=silence(0))
    assert not list(tmp_path.iterdir())
    with pytest.raises(errors.ExportError, match="does not exist"):
        write(tmp_path / "no" / path.name, black(1), fps=25, audio=silence(0.1))


def test_other_unusable_input_is_refused(tmp_path):
    with pytest.raises(errors.ExportError, match="XMP metadata"):
        mp4.write_mp4(tmp_path / "a.mp4", black(1), fps=25, audio=silence(0.1), xmp="x" * (2**24 + 1))
    with pytest.raises(errors.ExportError, match="frame 1"):
        mp4.write_with_alpha(tmp_path / "a.mov", frames(1) + frames(1, 3), fps=25, audio=tone())
    with pytest.raises(errors.ExportError, match="required one of"):
        mp4.write_with_alpha(tmp_path / "a.avi", frames(1), fps=25, audio=tone())


def moving(count: int, height: int = 96, width: int = 128) -> list[np.ndarray]:
    """Return frames of noise that moves, and changes a little from frame to frame."""
    draw = np.random.default_rng(0)
    large = draw.integers(60, 196, (height, width + count, 3))
    return [(large[:, n : n + width] + draw.integers(-4, 5, (height, width, 3))).astype(np.uint8) for n in range(count)]


def test_the_same_frames_give_the_same_bytes_whatever_the_number_of_processors(tmp_path):
    """The encoder writes its settings into the video; where the number of threads is its own choice, it varies."""
    for name in ("a.mp4", "b.mp4"):
        mp4.write_mp4(tmp_path / name, moving(40), fps=25, audio=silence(1.6), tags={"comment": "c"}, xmp="<x/>")
    content = (tmp_path / "a.mp4").read_bytes()
    assert content == (tmp_path / "b.mp4").read_bytes()
    assert b" bframes=0 " in content
    assert content.index(b"moov") < content.index(b"mdat")
    mp4.write_mp4(tmp_path / "a.mp4", moving(2, 720, 1280), fps=25, audio=silence(0.2))
    assert b" threads=4 " in (tmp_path / "a.mp4").read_bytes()


def test_tags_come_back_and_one_that_would_be_lost_is_refused(tmp_path):
    tags = {"encoder": "x", "colour": "y", "title": "z"}
    with pytest.raises(errors.ExportError, match="unknown tags colour, encoder; known: album"):
        mp4.write_mp4(tmp_path / "a.mp4", black(1), fps=25, audio=silence(0.1), tags=tags)
    assert not list(tmp_path.iterdir())
    tags = {name: f"{name}: größe\nline" for name in mp4.TAGS} | {"title": "a\udcffb"}
    mp4.write_mp4(tmp_path / "a.mp4", black(2), fps=25, audio=silence(0.1), tags=tags)
    with av.open(str(tmp_path / "a.mp4")) as container:
        assert {name: container.metadata.get(name) for name in mp4.TAGS} == tags | {"title": r"a\udcffb"}
    content = (tmp_path / "a.mp4").read_bytes()
    assert content.index(b"moov") < content.index("\xa9cmt".encode("latin-1")) < content.index(b"mdat")


def test_change_from_frame_to_frame_is_kept(tmp_path):
    """An encoder that predicts frames from both sides smooths what changes, and skin looks like wax."""
    y, x = np.mgrid[:96, :128]
    still = np.stack([127 + 60 * np.sin(x / 9), 127 + 60 * np.cos(y / 7), 100 + 0.5 * x], axis=2)
    draw = np.random.default_rng(0)
    frames = [np.rint(still + draw.normal(0, 3, (96, 128, 1))).astype(np.uint8) for _ in range(40)]
    mp4.write_mp4(tmp_path / "a.mp4", frames, fps=25, audio=silence(1.6))
    with av.open(str(tmp_path / "a.mp4")) as container:
        shown = [frame.to_ndarray()[:96] for frame in container.decode(video=0)]
    given = [av.VideoFrame.from_ndarray(frame).reformat(format="yuv420p").to_ndarray()[:96] for frame in frames]
    flicker = [np.abs(np.diff(np.array(pictures, float), 2, axis=0)).mean() for pictures in (shown, given)]
    assert 0.4 < flicker[0] / flicker[1] < 1.2


@pytest.fixture
def video(tmp_path):
    """A video without XMP."""
    mp4.write_mp4(tmp_path / "a.mp4", grey_frames(10, 32, 48), fps=25, audio=silence(0.4))
    return tmp_path / "a.mp4"


def read_xmp(path):
    with av.open(str(path), options={"export_xmp": "1"}) as container:
        return container.metadata.get("xmp")


def test_what_is_appended_is_read_the_video_stays_and_too_much_is_refused(video):
    before, shown = video.read_bytes(), pictures(video)[1]
    assert read_xmp(video) is None
    mp4.append_xmp(video, "<größe/>")
    assert read_xmp(video) == "<größe/>"
    assert video.read_bytes().startswith(before)
    assert pictures(video)[1] == pytest.approx(shown)
    with pytest.raises(errors.ExportError, match="at most"):
        mp4.append_xmp(video, "x" * (mp4.LARGEST_PACKET_BYTES + 1))


def test_what_does_not_end_with_a_whole_box_is_left_alone_and_long_ones_are_passed_over(tmp_path):
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
        with pytest.raises(errors.ExportError, match="not whole boxes"):
            mp4.append_xmp(path, "x")
        assert path.read_bytes() == content
    before = struct.pack(">I4sQ", 1, b"mdat", 20) + b"abcd" + struct.pack(">I4s", 26, b"uuid") + bytes(16) + b"no"
    path.write_bytes(before)
    mp4.append_xmp(path, "yes")
    assert path.read_bytes() == before + struct.pack(">I4s", 27, b"uuid") + mp4.XMP_UUID + b"yes"


def frames(count: int, channels: int = 4) -> list[np.ndarray]:
    """Return pictures of a square that moves right, opaque, on nothing."""
    drawn = [np.zeros((64, 96, channels), np.uint8) for _ in range(count)]
    for n, frame in enumerate(drawn):
        frame[16:48, 2 * n : 2 * n + 32] = (200, 60, 30, 255)[:channels]
    return drawn


def tone(duration_s: float = 1.0) -> types.Audio:
    return types.Audio(0.3 * np.sin(np.arange(int(duration_s * 16_000)) / 8).astype(np.float32), 16_000)


def decoded(path: Path) -> tuple[list[float], list[np.ndarray]]:
    """Return times and RGBA pictures. VP9's transparency is a second stream that only libvpx decodes."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        if stream.codec_context.name == "vp9":
            codec = av.CodecContext.create("libvpx-vp9", "r")
            packets = [packet for packet in container.demux(stream) if packet.size]
            shown = [(packet.pts * packet.time_base, frame) for packet in packets for frame in codec.decode(packet)]
        else:
            shown = [(frame.time, frame) for frame in container.decode(stream)]
    return [float(time_s) for time_s, _ in shown], [frame.to_ndarray(format="rgba") for _, frame in shown]


@pytest.mark.parametrize("suffix", [".webm", ".mov"])
@pytest.mark.parametrize("fps", [12, 29.97])
def test_pictures_come_back_at_their_times_with_their_transparency(tmp_path, suffix, fps):
    path = tmp_path / f"a{suffix}"
    written = frames(10)
    mp4.write_with_alpha(path, written, fps=fps, audio=tone())
    times, pictures = decoded(path)
    assert len(pictures) == 10
    assert times == pytest.approx(np.arange(10) / fps, abs=2e-3)
    for one, other in zip(written, pictures, strict=True):
        assert np.abs(one[..., 3].astype(int) - other[..., 3]).mean() < 4
        inside = one[..., 3] == 255
        assert np.abs(one[inside][:, :3].astype(int) - other[inside][:, :3]).mean() < 12
        assert np.abs(np.median(other[inside], axis=0) - (200, 60, 30, 255)).max() <= 4


@pytest.mark.parametrize("suffix", [".webm", ".mov"])
def test_the_sound_is_as_long_as_given_and_starts_at_zero(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    mp4.write_with_alpha(path, frames(25, 3), fps=25, audio=tone(1.3))
    with av.open(str(path)) as container:
        parts = list(container.decode(audio=0))
        assert parts[0].time == pytest.approx(0, abs=0.01)
        samples = np.concatenate([part.to_ndarray().ravel() for part in parts])
    assert len(samples) / 48_000 == pytest.approx(1.3, abs=0.03)
    assert np.abs(samples).max() > (0.2 if samples.dtype.kind == "f" else 0.2 * 32767)


def test_numbered_pictures_are_exact(tmp_path):
    for channels in (3, 4):
        written = frames(3, channels)
        mp4.write_pictures(tmp_path / "frame%03d.png", written)
        assert sorted(path.name for path in tmp_path.iterdir()) == ["frame000.png", "frame001.png", "frame002.png"]
        for n, frame in enumerate(written):
            assert np.array_equal(np.asarray(Image.open(tmp_path / f"frame{n:03d}.png")), frame)


def grey_frames(count: int = 3, height: int = 120, width: int = 160) -> list[np.ndarray]:
    return [np.full((height, width, 3), 10 * n, np.uint8) for n in range(count)]


def marked_part(frame: np.ndarray, marked: np.ndarray) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of what differs."""
    rows, columns = np.nonzero((frame != marked).any(axis=2))
    return int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1


@pytest.mark.parametrize("size", [(56, 72), (10, 300), (300, 10), (1, 1)])
@pytest.mark.parametrize("frame_size", [(120, 160), (480, 270)])
def test_it_lies_in_the_lower_right_corner(size, frame_size):
    (frame,), picture = grey_frames(1, *frame_size), np.full((*size, 3), 130, np.uint8)
    (made,) = add_inset([frame], [picture])
    assert (made.shape, made.dtype) == (frame.shape, np.uint8)
    left, top, right, bottom = marked_part(frame, made)
    assert place_inset(frame_size, size) == (left, top, right, bottom)
    margin = round(MARGIN_SHARE * min(frame_size))
    assert (bottom, right) == (frame_size[0] - margin, frame_size[1] - margin)
    inset = made[top:bottom, left:right]
    inner = (inset == 130).all(axis=2)
    assert 1 <= inner.any(axis=1).sum() <= HEIGHT_SHARE * frame_size[0] + 1
    assert 1 <= inner.any(axis=0).sum() <= WIDTH_SHARE * frame_size[1] + 1
    assert (inset[~inner] == WHITE).all()
    assert np.array_equal(np.unique(inset), [130, WHITE])


def test_the_picture_keeps_its_form_and_its_place():
    """A picture that is dark at the left and light at the right, and red above."""
    picture = np.zeros((56, 72, 3), np.uint8)
    picture[:, 36:, 1] = 200
    picture[:28, :, 0] = 200
    (frame,) = grey_frames(1, 288, 360)
    (made,) = add_inset([frame], [picture])
    left, top, right, bottom = marked_part(frame, made)
    inset = made[top:bottom, left:right].astype(int)
    inner = inset[2:-2, 2:-2]
    height, width = inner.shape[:2]
    assert width / height == pytest.approx(72 / 56, abs=0.03)
    assert inner[3, 3].tolist() == [200, 0, 0]
    assert inner[-4, 3].tolist() == [0, 0, 0]
    assert inner[3, -4].tolist() == [200, 200, 0]
    assert inner[-4, -4].tolist() == [0, 200, 0]
    assert np.abs(np.diff(inner[-4, :, 1])).argmax() == pytest.approx(width / 2, abs=1.5)
    (turned,) = add_inset([frame], [picture[::-1, ::-1]])
    assert np.abs(turned[top:bottom, left:right] - inset[::-1, ::-1]).max() <= 1


def test_every_frame_has_its_own_picture_and_is_not_changed():
    films, pictures = grey_frames(5), [np.full((56, 72, 3), 100 + n, np.uint8) for n in range(4)]
    before = [frame.copy() for frame in films]
    made = list(add_inset(films, pictures))
    assert len(made) == 4  # as many as there are of both
    assert [frame[-15, -15, 0] for frame in made] == [100, 101, 102, 103]
    assert all(np.array_equal(frame, old) for frame, old in zip(films, before, strict=True))
    assert [frame[0, 0, 0] for frame in made] == [0, 10, 20, 30]
    assert list(add_inset([], pictures)) == []


NAMES = {
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "iptc": "http://iptc.org/std/Iptc4xmpExt/2008-02-29/",
    "dc": "http://purl.org/dc/elements/1.1/",
}


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (288, 360, 3), np.uint8)


def test_a_marked_video_says_so_to_people_and_programs(tmp_path):
    mark = synthetic_mark.mark_metadata()
    mp4.write_mp4(tmp_path / "a.mp4", black(3), fps=25, audio=silence(0.1), tags=mark.tags, xmp=mark.xmp)
    with av.open(str(tmp_path / "a.mp4"), options={"export_xmp": "1"}) as container:
        assert container.metadata["comment"] == synthetic_mark.STATEMENT
        assert container.metadata["comment"].startswith("synthetic: ")
        assert synthetic_mark.SOURCE_TYPE in container.metadata["keywords"]
        packet = ElementTree.fromstring(container.metadata["xmp"].encode())  # noqa: S314  (our own)
    description = packet.find("rdf:RDF/rdf:Description", NAMES)
    assert description.findtext("iptc:DigitalSourceType", None, NAMES) == synthetic_mark.SOURCE_TYPE
    assert description.findtext("dc:description/rdf:Alt/rdf:li", None, NAMES) == synthetic_mark.STATEMENT


def test_any_statement_is_valid_xml():
    packet = ElementTree.fromstring(synthetic_mark.mark_metadata('<"&größe{}>').xmp.encode())  # noqa: S314
    assert packet.findtext(".//dc:description/rdf:Alt/rdf:li", None, NAMES) == '<"&größe{}>'
    odd = ElementTree.fromstring(synthetic_mark.mark_metadata("a\x00b\udcff\nc").xmp.encode())  # noqa: S314
    assert odd.findtext(".//dc:description/rdf:Alt/rdf:li", None, NAMES) == r"a\x00b\udcff\nc"


def test_every_frame_has_the_same_label_and_nothing_else_changes():
    frames = [noise(n) for n in range(3)]
    copies = [frame.copy() for frame in frames]
    marked = list(synthetic_mark.mark_frames(iter(frames)))
    assert len(marked) == 3
    ((left, top, right, bottom),) = {marked_part(*pair) for pair in zip(frames, marked, strict=True)}
    assert right > 345  # in the lower right corner,
    assert bottom > 275
    assert 30 < right - left < 90  # and small
    assert 10 < bottom - top < 25
    assert all((frame == copy).all() for frame, copy in zip(frames, copies, strict=True))


def test_the_label_is_legible_on_any_ground():
    for grey in (0, 128, 255):
        (marked,) = synthetic_mark.mark_frames([np.full((720, 1280, 3), grey, np.uint8)])
        part = marked[-70:, -160:, 0].astype(int)
        letters = (part > 225).mean() if grey < 225 else 1
        ground = part[(part < 160)]
        assert letters > 0.02
        assert ground.size > 0.2 * part.size
        assert part.max() - np.median(ground) > 80


@given(
    height=st.integers(40, 400).map(lambda n: 2 * n),
    width=st.integers(60, 640).map(lambda n: 2 * n),
    corners=st.tuples(*[st.floats(-0.2, 1.2)] * 4),
)
@settings(max_examples=25)
def test_the_face_is_left_free(height, width, corners):
    left, right = sorted(corners[:2])
    top, bottom = sorted(corners[2:])
    face = (left * width, top * height, right * width, bottom * height)
    frame = np.full((height, width, 3), 100, np.uint8)
    try:
        marked = next(synthetic_mark.mark_frames([frame], face))
    except errors.ExportError:
        for y, x in product((0, 1), (0, 1)):  # all corners are taken, or nearly so
            assert face[0] - 65 < x * width < face[2] + 65
            assert face[1] - 25 < y * height < face[3] + 25
        return
    changed = marked_part(frame, marked)
    assert changed[2] <= face[0] or changed[0] >= face[2] or changed[3] <= face[1] or changed[1] >= face[3]


def test_a_label_that_has_no_room_is_refused():
    with pytest.raises(errors.ExportError, match="no corner of the 360 × 288 px frame"):
        next(synthetic_mark.mark_frames([noise()], (5, 5, 355, 283)))
    with pytest.raises(errors.InputError, match="left before right"):
        next(synthetic_mark.mark_frames([noise()], (50, 5, 20, 283)))
    assert list(synthetic_mark.mark_frames([])) == []


def test_every_text_is_escaped_html_is_not_and_attributes_are_named_as_there():
    made = element("p", "<b>&\u202e", element("b", "bold"), title='"quoted"')
    assert made == '<p title="&quot;quoted&quot;">&lt;b&gt;&amp;\\u202e<b>bold</b></p>'
    assert joined("a < b", Html("<br>")) == "a &lt; b<br>"
    video = element("video", class_="shown", aria_label="a", controls=True, hidden=False, poster=None)
    assert video == '<video class="shown" aria-label="a" controls></video>'
    assert element("img", src="a.png") == '<img src="a.png">'


@pytest.mark.parametrize("name", ["b onclick=x", "", "1", "a>"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(ValueError, match="is no name of an element or an attribute"):
        element(name)
    with pytest.raises(ValueError, match="is no name of an element or an attribute"):
        element("p", **{name: "x"})


def test_a_page_loads_nothing_from_elsewhere_and_all_have_the_same_colours():
    page = build_page("</title><script>", f"{SHARED_COLOURS} p {{ color: red; }}", element("p", "text"))
    assert "<title>&lt;/title&gt;&lt;script&gt;</title>" in page
    assert "default-src &#x27;none&#x27;" in page
    assert "script-src" not in page
    assert not re.search("https?:|//", page)
    body = page[page.index("<body>") : page.index("</body>") + len("</body>")]
    assert ElementTree.fromstring(body).find("p").text == "text"  # noqa: S314 (our own)
    light, dark = insert_colours(SHARED_COLOURS).split("prefers-color-scheme: dark")
    assert set(re.findall(r"--[\w-]+(?=:)", light)) == set(re.findall(r"--[\w-]+(?=:)", dark))
