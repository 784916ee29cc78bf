from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from lipmotion.errors import ExportError
from lipmotion.types import Audio
from lipmotion_faces.video.mp4 import write_pictures, write_with_alpha

HZ = 16_000


def frames(count: int, channels: int = 4) -> list[np.ndarray]:
    """Return pictures of a square that moves right, opaque, on nothing."""
    drawn = [np.zeros((64, 96, channels), np.uint8) for _ in range(count)]
    for n, frame in enumerate(drawn):
        frame[16:48, 2 * n : 2 * n + 32] = (200, 60, 30, 255)[:channels]
    return drawn


def tone(duration_s: float = 1.0) -> Audio:
    return Audio(0.3 * np.sin(np.arange(int(duration_s * HZ)) / 8).astype(np.float32), HZ)


def decoded(path: Path) -> tuple[list[float], list[np.ndarray]]:
    """Return times and RGBA pictures. VP9's transparency is a second stream that only libvpx decodes."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        times, pictures = [], []
        if stream.codec_context.name == "vp9":
            codec = av.CodecContext.create("libvpx-vp9", "r")
            packets = [packet for packet in container.demux(stream) if packet.size]
            shown = [(packet, frame) for packet in packets for frame in codec.decode(packet)]
            times = [float(packet.pts * packet.time_base) for packet, _ in shown]
            pictures = [frame.to_ndarray(format="rgba") for _, frame in shown]
        else:
            for frame in container.decode(stream):
                times.append(frame.time)
                pictures.append(frame.to_ndarray(format="rgba"))
    return times, pictures


@pytest.mark.parametrize("suffix", [".webm", ".mov"])
@pytest.mark.parametrize("fps", [12, 29.97])
def test_pictures_come_back_at_their_times_with_their_transparency(tmp_path, suffix, fps):
    path = tmp_path / f"a{suffix}"
    written = frames(10)
    write_with_alpha(path, written, fps=fps, audio=tone())
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
    write_with_alpha(path, frames(25, 3), fps=25, audio=tone(1.3))
    with av.open(str(path)) as container:
        parts = list(container.decode(audio=0))
        assert parts[0].time == pytest.approx(0, abs=0.01)
        samples = np.concatenate([part.to_ndarray().ravel() for part in parts])
    assert len(samples) / 48_000 == pytest.approx(1.3, abs=0.03)
    assert np.abs(samples).max() > (0.2 if samples.dtype.kind == "f" else 0.2 * 32767)


def test_numbered_pictures_are_exact(tmp_path):
    for channels in (3, 4):
        written = frames(3, channels)
        write_pictures(tmp_path / "frame%03d.png", written)
        assert sorted(path.name for path in tmp_path.iterdir()) == ["frame000.png", "frame001.png", "frame002.png"]
        for n, frame in enumerate(written):
            assert np.array_equal(np.asarray(Image.open(tmp_path / f"frame{n:03d}.png")), frame)


def test_what_cannot_be_written_is_refused_and_leaves_no_file(tmp_path):
    for suffix, pictures, fps, sound, message in (
        (".webm", [], 25, tone(), "no frames"),
        (".webm", [np.zeros((63, 96, 4), np.uint8)], 25, tone(), "even sizes"),
        (".mov", frames(1) + frames(1, 3), 25, tone(), "frame 1"),
        (".mov", frames(1), 0, tone(), "frame rate"),
        (".mov", frames(1), 25, Audio(np.zeros(0, np.float32), HZ), "no samples"),
        (".avi", frames(1), 25, tone(), "required one of"),
    ):
        with pytest.raises(ExportError, match=message):
            write_with_alpha(tmp_path / f"a{suffix}", pictures, fps=fps, audio=sound)
        assert not list(tmp_path.iterdir())
