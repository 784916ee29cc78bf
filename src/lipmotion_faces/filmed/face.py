"""A filmed face as a value and as a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.storage import schema
from lipmotion.storage.archive import UNREADABLE, read_archive, read_header_of, write_archive
from lipmotion.storage.sources import check_source
from lipmotion.types import Audio, Channel, Motion
from lipmotion_faces.appearance.person import Appearance, appearance_from_arrays, appearance_to_arrays
from lipmotion_faces.coded_video import STORED_VIDEO, StoredVideo, stored_video_from_arrays, stored_video_to_arrays

Array = NDArray[np.float64]

FORMAT, VERSION = "lipmotion.face", 1
SUFFIX = ".face"
FULL_SCALE = 32767  # full scale of the stored sound


@dataclass(frozen=True, eq=False)
class StoredBackground:
    """A background sequence: footage of the person, with the place of the face in every frame."""

    video: StoredVideo  # T frames, of even height and width
    face_to_frame: Array  # affine maps from px of the face to px of the frame [shape=(T, 2, 3)]
    chin_px: Array  # how far the tip of the chin is below the eyes in each frame, px of the face [shape=(T,)]
    cuts: tuple[int, ...] = ()  # frames at which another part of the footage begins, rising


@dataclass(frozen=True, eq=False)
class SpokenTake:
    """Speech and motion of the person, at the video's rate, onto which other people's is mapped; seen [shape=(T,)]."""

    sound: Audio
    motion: Motion
    seen: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FilmedFace:
    """The face of a person, from footage.

    appearance : what mouth and jaw look like
    background : the footage into which they are stitched if there is no other
    takes      : speech with motion
    about      : information for users: ``name``, ``corpus``, ``speaker``, ``licence``, ``attribution``, ``footage_s``
    Make one with ``build_face``, or read one with ``load_face``.

    >>> import lipmotion
    >>> lipmotion.load_face("anna.face").summary["resolution"]  # doctest: +SKIP
    '2 samples a pixel, 90 px between the eyes'
    """

    appearance: Appearance
    background: StoredBackground
    takes: tuple[SpokenTake, ...]
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def summary(self) -> dict[str, str]:
        """A description of the face for users, by keyword."""
        appearance, video = self.appearance, self.background.video
        height, width = video.size
        seconds = len(video) / video.rate_hz
        explained = [f"{100 * float(space.explained.mean()):.1f} %" for space in (appearance.mouth, appearance.jaw)]
        described = {
            key: "; ".join(map(str, value)) if isinstance(value, list) else str(value)
            for key, value in self.about.items()
        }
        return described | {
            "mouth": f"{appearance.mouth.summary}; {len(appearance.mouths)} candidates",
            "jaw": f"{len(appearance.jaw.channels)} components, {explained[1]} of the variance; "
            f"{len(appearance.jaws)} candidates",
            "resolution": f"{appearance.scale} samples a pixel, 90 px between the eyes",
            "background": f"{seconds:.1f} s of {width} × {height} px at {video.rate_hz:g} frames a second",
            "needs": f"{len(appearance.from_motion.names)} channels of tracked points, or eigenlips",
        }


def save_face(face: FilmedFace, path: str | Path) -> None:
    """Write a face to a file: a zip of plain arrays and a JSON header, whole or not at all, never pickle.

    Raises ExportError: the file cannot be written.

    >>> import lipmotion
    >>> lipmotion.save_face(lipmotion.build_face("anna.mp4"), "anna.face")  # doctest: +SKIP
    """
    background, takes = face.background, face.takes
    channels = takes[0].motion.channels if takes else ()
    arrays = {f"appearance/{name}": array for name, array in appearance_to_arrays(face.appearance).items()}
    arrays |= {f"background/{name}": array for name, array in stored_video_to_arrays(background.video).items()}
    arrays |= {"background/face_to_frame": background.face_to_frame, "background/chin_px": background.chin_px}
    arrays |= {"background/cuts": np.array(background.cuts, np.intp)}
    for number, take in enumerate(takes):
        arrays |= {
            f"take{number}/sound": np.rint(np.clip(take.sound.samples, -1, 1) * FULL_SCALE).astype(np.int16),
            f"take{number}/sound_rate_hz": np.array(take.sound.rate_hz),
            f"take{number}/motion": np.asarray(take.motion.values, np.float32),
            f"take{number}/rate_hz": np.array(take.motion.rate_hz),
            f"take{number}/seen": take.seen,
        }
    described = [{"name": channel.name, "unit": channel.unit} for channel in channels]
    header = {"format": FORMAT, "version": VERSION, "about": dict(face.about), "takes": len(takes)}
    write_archive(Path(path), header | {"channels": described}, arrays)


def load_face(path: str | Path) -> FilmedFace:
    """Return the face in a file.

    Raises InputError: no such file. Raises ModelFormatError: not a face, damaged, or of another version.

    >>> import lipmotion
    >>> face = lipmotion.load_face("anna.face")  # doctest: +SKIP
    """
    path = Path(path)
    check_source(path, "face")
    header = read_header_of(path, FORMAT, VERSION, "face", "give a file that `lipmotion face build` wrote")
    try:
        arrays = read_archive(path)
        with schema.format_errors("the face", "build it again"):
            count = int(header["takes"])
            if not 0 <= count <= MAX_TAKES:
                raise ValueError(f"{count} takes, required 0 to {MAX_TAKES}")
            folders = ("appearance", "background", *(f"take{number}" for number in range(count)))
            inner = {folder: schema.select_arrays(arrays, f"{folder}/") for folder in folders}
            schema.refuse_undeclared(arrays, (f"{folder}/{key}" for folder, part in inner.items() for key in part))
            channels = tuple(Channel(str(item["name"]), str(item["unit"])) for item in header["channels"])
            takes = tuple(_take(inner[f"take{number}"], channels) for number in range(count))
            about = header["about"]
            if not isinstance(about, dict):
                raise TypeError("about is no table")
            return FilmedFace(
                appearance_from_arrays(inner["appearance"]), _read_background(inner["background"]), takes, about
            )
    except (ModelFormatError, InputError) as error:
        raise ModelFormatError(f"{path}: {error}") from error
    except UNREADABLE as error:
        raise ModelFormatError(f"{path}: the face is damaged ({error}); build it again") from error


MAX_TAKES = 1000
BACKGROUND = {
    "face_to_frame": schema.ArraySpec(np.float64, "T 2 3", -1e5, 1e5),
    "chin_px": schema.ArraySpec(np.float64, "T", 0, 1000),
    "cuts": schema.ArraySpec(np.intp, "c", 1, schema.LARGEST_NUMBER, optional=True),
}
TAKE = {
    "sound": schema.ArraySpec(np.int16, "S", -FULL_SCALE - 1, FULL_SCALE),
    "sound_rate_hz": schema.ArraySpec(np.intp, "", 8000, 48_000),
    "motion": schema.ArraySpec(np.float32, "T C"),
    "rate_hz": schema.ArraySpec(np.float64, "", schema.POSITIVE, 1000),
    "seen": schema.ArraySpec(np.bool_, "T"),
}


def _read_background(arrays: schema.Arrays) -> StoredBackground:
    schema.refuse_undeclared(arrays, BACKGROUND, STORED_VIDEO)
    video = stored_video_from_arrays({name: array for name, array in arrays.items() if name not in BACKGROUND})
    stored = schema.check_arrays(arrays, BACKGROUND, T=len(video))
    maps = stored["face_to_frame"]
    if (np.abs(np.linalg.det(maps[:, :, :2])) < MIN_DETERMINANT).any() or any(length % 2 for length in video.size):
        raise ValueError("flat places of the face, or frames of odd sizes")
    cuts = stored.arrays.get("cuts", np.zeros(0, np.intp))
    if (np.diff(cuts) < 1).any() or (cuts >= len(video)).any():
        raise ValueError(f"cuts {cuts.tolist()} of a background of {len(video)} frames")
    return StoredBackground(video, maps, stored["chin_px"], tuple(cuts.tolist()))


MIN_DETERMINANT = 1e-6  # a map with a smaller determinant has no inverse


def _take(arrays: schema.Arrays, channels: tuple[Channel, ...]) -> SpokenTake:
    schema.refuse_undeclared(arrays, TAKE)
    stored = schema.check_arrays(arrays, TAKE, C=len(channels))
    sound = Audio(stored["sound"].astype(np.float32) / np.float32(FULL_SCALE), int(stored["sound_rate_hz"]))
    motion = Motion(stored["motion"].astype(np.float64), float(stored["rate_hz"]), channels)
    return SpokenTake(sound, motion, stored["seen"])
