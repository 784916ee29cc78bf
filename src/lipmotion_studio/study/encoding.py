"""Videos as every browser plays them, all encoded alike; some cut to a region, some out of step with the sound."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.storage.media import open_media
from lipmotion.types import Audio
from lipmotion_faces.tracking.footage import read_video_frames
from lipmotion_faces.video.mp4 import SOUND_HZ, write_mp4
from lipmotion_faces.video.synthetic_mark import LABEL, SOURCE_TYPE, mark_metadata
from lipmotion_studio.study.region import Region

Pictures = NDArray[np.uint8]


def encode_shown(source: Path, target: Path, sound: Path, region: Region, late_ms: float = 0.0) -> float:
    """Write a video as raters see it (H.264, AAC), and return how long it lasts, in seconds.

    sound   : the recording whose sound a video without sound gets
    late_ms : how much later than it was the sound comes; the video keeps its length
    The mark of a synthetic video stays: raters do not see it, whoever gets the file can.
    Raises InputError: it cannot be read, or the region is too small. Raises ExportError: it cannot be written.
    """
    frames, rate_hz = read_video_frames(source)
    played = read_audio(source if _has_sound(source) else sound, SOUND_HZ, warn=False)
    counted = _Counted(region.cut(frame) for frame in frames)
    mark = mark_metadata() if _is_marked(source) else None
    marked: dict[str, Any] = {"tags": mark.tags, "xmp": mark.xmp} if mark else {}
    write_mp4(target, counted, fps=rate_hz, audio=_later(played, late_ms), **marked)
    return max(counted.count / rate_hz, played.duration_s)


class _Counted:
    """Pictures, and how many have been taken."""

    def __init__(self, pictures: Iterable[Pictures]) -> None:
        self._pictures = pictures
        self.count = 0

    def __iter__(self) -> Iterator[Pictures]:
        for picture in self._pictures:
            self.count += 1
            yield picture


def _later(audio: Audio, late_ms: float) -> Audio:
    """Return sound that begins later, after silence, and has the same length."""
    shift = round(late_ms / 1000 * audio.rate_hz)
    if not 0 <= shift < len(audio.samples):
        raise InputError(f"the sound of {audio.duration_s:.2f} s cannot be {late_ms:g} ms late; give longer sentences")
    return Audio(
        np.concatenate([np.zeros(shift, np.float32), audio.samples[: len(audio.samples) - shift]]), audio.rate_hz
    )


def _is_marked(path: Path) -> bool:
    """Return whether the metadata of a video say that it is synthetic."""
    with open_media(path) as container:
        return any(SOURCE_TYPE in text or text.startswith(LABEL) for text in container.metadata.values())


def _has_sound(path: Path) -> bool:
    with open_media(path) as container:
        return bool(container.streams.audio)
