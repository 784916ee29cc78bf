import xml.etree.ElementTree as ET
from importlib import metadata
from itertools import product

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import ExportError, InputError
from lipmotion.types import Audio
from lipmotion_faces.video.mp4 import write_mp4
from lipmotion_faces.video.synthetic_mark import SOURCE_TYPE, STATEMENT, mark_frames, mark_metadata

NAMES = {
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "iptc": "http://iptc.org/std/Iptc4xmpExt/2008-02-29/",
    "dc": "http://purl.org/dc/elements/1.1/",
}


def noise(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)


def marked_part(frame: np.ndarray, marked: np.ndarray) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of what differs."""
    rows, columns = np.nonzero((frame != marked).any(axis=2))
    return int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1


def test_a_marked_video_says_so_to_people_and_programs(tmp_path):
    mark = mark_metadata()
    frames = [np.zeros((64, 96, 3), np.uint8)] * 3
    audio = Audio(np.zeros(1600, np.float32), 16_000)
    write_mp4(tmp_path / "a.mp4", frames, fps=25, audio=audio, tags=mark.tags, xmp=mark.xmp)
    with av.open(str(tmp_path / "a.mp4"), options={"export_xmp": "1"}) as container:
        assert container.metadata["comment"] == STATEMENT
        assert container.metadata["comment"].startswith("synthetic: ")
        assert SOURCE_TYPE in container.metadata["keywords"]
        packet = ET.fromstring(container.metadata["xmp"].encode())  # noqa: S314  (our own)
    description = packet.find("rdf:RDF/rdf:Description", NAMES)
    assert description.findtext("iptc:DigitalSourceType", None, NAMES) == SOURCE_TYPE
    assert description.findtext("dc:description/rdf:Alt/rdf:li", None, NAMES) == STATEMENT


def test_any_statement_is_valid_xml():
    packet = ET.fromstring(mark_metadata('<"&größe{}>').xmp.encode())  # noqa: S314
    assert packet.findtext(".//dc:description/rdf:Alt/rdf:li", None, NAMES) == '<"&größe{}>'
    odd = ET.fromstring(mark_metadata("a\x00b\udcff\nc").xmp.encode())  # noqa: S314
    assert odd.findtext(".//dc:description/rdf:Alt/rdf:li", None, NAMES) == r"a\x00b\udcff\nc"


def test_every_frame_has_the_same_label_and_nothing_else_changes():
    frames = [noise(288, 360, n) for n in range(3)]
    copies = [frame.copy() for frame in frames]
    marked = list(mark_frames(iter(frames)))
    assert len(marked) == 3
    parts = {marked_part(*pair) for pair in zip(frames, marked, strict=True)}
    (left, top, right, bottom), *others = parts
    assert not others
    assert right > 345  # in the lower right corner,
    assert bottom > 275
    assert 30 < right - left < 90  # and small
    assert 10 < bottom - top < 25
    assert all((frame == copy).all() for frame, copy in zip(frames, copies, strict=True))


def test_the_label_is_legible_on_any_ground():
    for grey in (0, 128, 255):
        (marked,) = mark_frames([np.full((720, 1280, 3), grey, np.uint8)])
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
        marked = next(mark_frames([frame], face))
    except ExportError:
        for y, x in product((0, 1), (0, 1)):  # all corners are taken, or nearly so
            assert face[0] - 65 < x * width < face[2] + 65
            assert face[1] - 25 < y * height < face[3] + 25
        return
    changed = marked_part(frame, marked)
    assert changed[2] <= face[0] or changed[0] >= face[2] or changed[3] <= face[1] or changed[1] >= face[3]


def test_a_label_that_has_no_room_is_refused():
    with pytest.raises(ExportError, match="no corner of the 360 × 288 px frame"):
        next(mark_frames([noise(288, 360)], (5, 5, 355, 283)))
    with pytest.raises(InputError, match="left before right"):
        next(mark_frames([noise(288, 360)], (50, 5, 20, 283)))
    assert list(mark_frames([])) == []


def test_a_program_that_is_not_installed_has_a_mark_too(monkeypatch):
    def nothing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", nothing)
    assert "lipmotion source" in mark_metadata().xmp
