"""The mark of synthetic video: metadata that people and programs can read, and a label in a corner of the picture.

Only for videos that look recorded: a drawn face needs none. What a mark does and does not do: docs/consent.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import find_version
from lipmotion.printable import printable

Frame = NDArray[np.uint8]
Box = tuple[float, float, float, float]  # left, top, right and bottom, px from the upper left corner of the frame

SOURCE_TYPE = "http://cv.iptc.org/newscodes/digitalsourcetype/compositeWithTrainedAlgorithmicMedia"
"""IPTC's digital source type for recorded pictures into which parts were set that a model learned from recordings."""
STATEMENT = (
    "synthetic: the movements of the mouth and the jaw in this video were generated from speech by a computer "
    "(lipmotion); they were not recorded"
)
"""What the metadata says. It begins with the word to search for."""
LABEL = "synthetic"
LETTER_SHARE, SMALLEST_LETTERS_PX = 0.035, 9
"""Height of the label's letters, as a share of the frame's shorter side, and the least that can be read, px."""
EDGE_DISTANCE = 0.8  # distance of the label from the edges of the frame, relative to the height of its letters
GROUND_OPACITY, LETTER_OPACITY = 0.45, 0.9  # opacity of the label's black ground, and of its white letters


class MarkMetadata(NamedTuple):
    """The mark as arguments of ``write_mp4``.

    tags : what players show; the keywords hold ``SOURCE_TYPE`` too, as programs that copy a video often drop the packet
    xmp  : packet for programs, in which ``SOURCE_TYPE`` is the property DigitalSourceType of the IPTC
    """

    tags: dict[str, str]
    xmp: str


def mark_metadata(statement: str = STATEMENT) -> MarkMetadata:
    """Return the metadata that say that a video is synthetic.

    statement : what the comment says, for people; in the packet without line ends and control characters
    Source: IPTC Digital Source Type NewsCodes; IPTC Video Metadata Hub; Adobe, XMP Specification Part 1.
    """
    text = escape(printable(statement), quote=False)
    xmp = _PACKET.format(statement=text, source_type=SOURCE_TYPE, tool=f"lipmotion {find_version()}")
    return MarkMetadata({"comment": statement, "keywords": f"{LABEL}, {SOURCE_TYPE}"}, xmp)


def mark_frames(frames: Iterable[Frame], face: Box | None = None) -> Iterator[Frame]:
    """Yield the frames with a small label in a corner, in the same place in all of them; the frames are not changed.

    frames : uint8 RGB [shape=(H, W, 3)], all of one size; taken one at a time
    face   : the part of the frames in which the face is at any time, which the label leaves free. Of the corners that
             are free, the first in this order is taken: lower right, lower left, upper right, upper left.
    Raises ExportError: the face leaves no corner for letters of ``SMALLEST_LETTERS_PX`` px.
    Raises InputError: the face is no such box.
    """
    if face is not None and not (face[0] <= face[2] and face[1] <= face[3]):
        required = "left, top, right and bottom in px, left before right, top over bottom"
        raise InputError(f"face {face}, required: {required}")
    placed: tuple[int, int, NDArray[np.float32], NDArray[np.float32]] | None = None
    for frame in frames:
        placed = placed or _place_label(frame.shape[0], frame.shape[1], face)
        top, left, ground, letters = placed
        marked = frame.copy()
        part = marked[top : top + ground.shape[0], left : left + ground.shape[1]]
        part[...] = np.rint(part * (1 - ground[..., None]) + letters[..., None])
        yield marked


def _place_label(
    height: int, width: int, face: Box | None
) -> tuple[int, int, NDArray[np.float32], NDArray[np.float32]]:
    """Return top and left of the label in the first free corner, as large as possible, its ground and its letters.

    The frame becomes frame · (1 − ground) + letters [shapes=(h, w)]. Raises ExportError: no corner is free.
    """
    largest = max(SMALLEST_LETTERS_PX, round(LETTER_SHARE * min(height, width)))
    for size in range(largest, SMALLEST_LETTERS_PX - 1, -1):
        ground, letters = _draw(size)
        rows, columns = ground.shape
        space = round(EDGE_DISTANCE * size)
        for top in (height - space - rows, space):
            for left in (width - space - columns, space):
                inside = 0 <= top <= height - rows and 0 <= left <= width - columns
                x, y, right, bottom = face or (width, height, width, height)
                is_free = left + columns <= x or right <= left or top + rows <= y or bottom <= top
                if inside and is_free:
                    return top, left, ground, letters
    raise ExportError(
        f"no corner of the {width} × {height} px frame has room for the label {LABEL!r} beside the face {face}; "
        "use a video with more space around the face, or the mark in the metadata alone"
    )


def _draw(size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return opacity and grey levels of the label: white letters of ``size`` px on a dark ground with round corners."""
    from PIL import Image, ImageDraw, ImageFont

    font: Any = ImageFont.load_default(size)
    left, top, right, bottom = font.getbbox(LABEL)
    across, down = round(0.45 * size), round(0.3 * size)
    room = (int(np.ceil(right - left)) + 2 * across, int(np.ceil(bottom - top)) + 2 * down)
    finer = Image.new("L", (room[0] * 4, room[1] * 4))
    ImageDraw.Draw(finer).rounded_rectangle((0, 0, room[0] * 4 - 1, room[1] * 4 - 1), 4 * down, fill=255)
    shape = np.asarray(finer.resize(room, Image.Resampling.BOX), np.float32) / 255
    text = Image.new("L", room)
    ImageDraw.Draw(text).text((across - left, down - top), LABEL, fill=255, font=font)
    letters = (LETTER_OPACITY / 255) * np.asarray(text, np.float32)
    ground = letters + (1 - letters) * GROUND_OPACITY * shape
    return ground.astype(np.float32), (255 * letters).astype(np.float32)


_PACKET = Path(__file__).with_name("xmp_packet.xml").read_text(encoding="utf-8")
