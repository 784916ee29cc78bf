import struct

import av
import numpy as np
import pytest

from lipmotion.errors import ExportError
from lipmotion.types import Audio
from lipmotion_faces.video.mp4 import LARGEST_PACKET_BYTES, XMP_UUID, append_xmp, write_mp4


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
