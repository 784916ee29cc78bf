"""Video of a filmed face: generated motion, stitched into footage of the person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.eigenlips import Eigenlips
from lipmotion.appearance.person import FaceCodes
from lipmotion.errors import InputError
from lipmotion.faces.base import Face
from lipmotion.faces.filmed.face import FilmedFace
from lipmotion.faces.filmed.renderer import BATCH, STITCHING, Stitcher, StitchingOptions
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.film.background import open_background, stored_sequence
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import SpeechRequest
from lipmotion.speech.pauses import STEP_S, levels_db
from lipmotion.types import GREY, Audio, Motion

Floats = NDArray[np.float32]
Frames = Iterator[NDArray[np.uint8]]
Jaw = Literal["motion", "energy", "none"]
JAWS: tuple[Jaw, ...] = ("motion", "energy", "none")


@dataclass(frozen=True)
class FilmOptions:
    """How a filmed face is shown.

    background : footage of the same person into which mouth and jaw are stitched; None: the one in the face's file
    jaw        : what the jaw follows: the motion, the energy of the sound (Xie & Liu 2007, §6.2), or the background's
                 own motion (``none``)
    stitching  : how pictures are made
    """

    background: Path | None = None
    jaw: Jaw = "motion"
    stitching: StitchingOptions = STITCHING


FILM = FilmOptions()


@one_thread()
def filmed_frames(
    face: FilmedFace,
    motion: Motion,
    *,
    sound: Audio | None = None,
    eigenlips: Eigenlips | None = None,
    fps: float | None = None,
    options: FilmOptions = FILM,
) -> tuple[Frames, float]:
    """Return the frames of a video [each shape=(H, W, 3)], of even sizes, and their rate.

    face      : of the person
    motion    : of tracked points of the same person, or eigenlips
    sound     : for a jaw that follows the energy
    eigenlips : of the model that generated ``motion``, if it has any
    fps       : frames a second; None: those of the footage
    Frame n shows the time n / fps; the last one is at or before the end of the motion. Frames are made a few at a time.
    Raises InputError: motion without the channels that the face needs, no sound for ``energy``, a background in which
    there is no face, or a rate that is not positive.
    """
    background = stored_sequence(face.background) if options.background is None else open_background(options.background)
    rate_hz = background.rate_hz if fps is None else fps
    if not 0 < rate_hz < float("inf"):
        raise InputError(f"the frame rate is {rate_hz}, required more than 0")
    count = int(np.floor((len(motion.values) - 1) / motion.rate_hz * rate_hz + 1e-9)) + 1
    codes = face_codes(face, motion, count, rate_hz, eigenlips)
    if options.jaw == "energy":
        codes = face.appearance.with_jaw_of_sound(codes, _levels(sound, count, rate_hz))
    stitcher = Stitcher(
        face.appearance, options.stitching if options.jaw != "none" else _without_jaw(options.stitching)
    )
    return stitcher.stitch(codes, background.frames(count, rate_hz)), rate_hz


def face_codes(
    face: FilmedFace, motion: Motion, count: int, rate_hz: float, eigenlips: Eigenlips | None = None
) -> FaceCodes:
    """Return what the lower face is like in ``count`` frames at the rate of a video.

    Raises InputError: motion without the channels that the face needs.
    """
    shown = Motion(motion.at(np.arange(count) / rate_hz), rate_hz, motion.channels)
    if eigenlips is None or not all(channel in shown.channels for channel in eigenlips.channels):
        return face.appearance.of_motion(shown)
    values = shown.values[:, [shown.column(channel.name) for channel in eigenlips.channels]]
    starts = range(0, count, BATCH)
    parts = [face.appearance.of_mouths(eigenlips.restore(values[start : start + BATCH])) for start in starts]
    mouth, jaw, chin_px = (np.concatenate(values) for values in zip(*map(_fields, parts), strict=True))
    if all(channel.unit == GREY for channel in shown.channels):
        return FaceCodes(mouth, jaw, chin_px)
    return replace(face.appearance.of_motion(shown), mouth=mouth)  # points tell the jaw better


def _fields(codes: FaceCodes) -> tuple[Floats, Floats, Floats]:
    return codes.mouth, codes.jaw, codes.chin_px


def onto_face(request: SpeechRequest, model: Model, face: Face | FilmedFace) -> SpeechRequest:
    """Return a request for the motion of the person whom a face shows.

    A drawn face shows anybody; motion of another person than a filmed face's is mapped onto it (``map_onto``).
    Raises InputError: a filmed face is of another person, and the model generates eigenlips alone.
    """
    if not isinstance(face, FilmedFace) or request.onto is not None or is_person_of(model, face, request.speaker):
        return request
    return replace(request, onto=face)


def is_person_of(model: Model, face: FilmedFace, speaker: str = "") -> bool:
    """Return whether a model generates the motion of the person of a face: they are of one corpus and speaker.

    speaker : of the people of the model whose motion is generated
    Raises InputError: it does not, and generates eigenlips alone, which cannot be mapped onto another person.
    """
    people = model.about.get("speakers") or [""]
    same = bool(set(model.about.get("corpus", ())) & set(face.about.get("corpus", ())))
    same = same and (len(people) < 2 or speaker == face.about.get("speaker"))
    if not same and model.visual == "eigenlips":
        raise InputError(
            "the model generates mouth pictures of the person of "
            f"{'; '.join(map(str, model.about.get('corpus', ['another corpus'])))}, the face is that of another; use a "
            "model of tracked points, or train one of eigenlips on this person"
        )
    return same


def _levels(sound: Audio | None, count: int, rate_hz: float) -> NDArray[np.float64]:
    """Return the level of the sound in every frame of a video, dB [shape=(count,)]."""
    if sound is None:
        raise InputError("a jaw that follows the energy needs the sound; give the recording")
    levels = levels_db(sound)
    centres_s = (np.arange(len(levels)) + 0.5) * STEP_S
    return np.interp(np.arange(count) / rate_hz, centres_s, levels)


def _without_jaw(stitching: StitchingOptions) -> StitchingOptions:
    return replace(stitching, jaw=False)


def write_film(
    path: Path,
    face: FilmedFace,
    motion: Motion,
    sound: Audio,
    *,
    model: Model | None = None,
    fps: float | None = None,
    options: FilmOptions = FILM,
) -> None:
    """Write a video of a filmed face, with sound; whole or not at all.

    model : that generated the motion; needed where the motion is eigenlips
    Raises InputError: as ``filmed_frames``. Raises ExportError: the file cannot be written.
    """
    from lipmotion.export.video import write_mp4

    eigenlips = model.eigenlips if model is not None else None
    frames, rate_hz = filmed_frames(face, motion, sound=sound, eigenlips=eigenlips, fps=fps, options=options)
    write_mp4(path, frames, fps=rate_hz, audio=sound)
