"""Video of a filmed face: generated motion, stitched into footage of the person."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import FULL_DEFICIT_GAP, close_lips, gap_to_opening, read_gap, sample_pictures
from lipmotion.errors import InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.motion.eigenlips import Eigenlips
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Mark, Outputs
from lipmotion.storage.sources import check_source, has_video
from lipmotion.types import GREY, Audio, Monitor, Motion, Timeline, Unit, silent_monitor
from lipmotion.types.motion import compute_frame_times
from lipmotion.types.progress import REPORT_INTERVAL, with_progress
from lipmotion_faces.appearance.person import FaceCodes, measure_levels_at
from lipmotion_faces.appearance.placing import cut
from lipmotion_faces.film.background import open_background, open_stored_background
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.filmed.renderer import AS_PRINTED, BATCH, STITCHING, Stitcher
from lipmotion_faces.tracking.track import read_video_frames
from lipmotion_faces.video.mp4 import write_mp4
from lipmotion_faces.video.synthetic_mark import mark_frames, mark_metadata

Frame = NDArray[np.uint8]

WIDTH_SHARE, HEIGHT_SHARE = 0.33, 0.4  # largest width and height of the inset, as shares of the frame's
MARGIN_SHARE = 0.02  # distance from the edges of the frame, as a share of its shorter side
BORDER_SHARE = 0.006  # width of the white border, as a share of the frame's shorter side
WHITE = 245


def place_inset(frame: tuple[int, int], picture: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom, px, of the inset with its border; frame, picture: height and width."""
    height, width = frame
    shorter = min(height, width)
    factor = min(WIDTH_SHARE * width / picture[1], HEIGHT_SHARE * height / picture[0])
    rows, columns = (max(1, round(length * factor)) for length in picture)
    bottom, right = (length - round(MARGIN_SHARE * shorter) for length in frame)
    border = max(1, round(BORDER_SHARE * min(frame)))
    return right - columns - 2 * border, bottom - rows - 2 * border, right, bottom


def add_inset(frames: Iterable[Frame], pictures: Iterable[Frame]) -> Iterator[Frame]:
    """Yield frames with a picture in the lower right corner; as many as there are of both.

    frames   : uint8 RGB [each shape=(H, W, 3)], of one size; they are not changed
    """
    for frame, picture in zip(frames, pictures, strict=False):
        size = (frame.shape[0], frame.shape[1])
        left, top, right, bottom = place_inset(size, (picture.shape[0], picture.shape[1]))
        border = max(1, round(BORDER_SHARE * min(size)))
        rows, columns = bottom - top - 2 * border, right - left - 2 * border
        steps = picture.shape[1] / columns, picture.shape[0] / rows
        to_picture = np.array([[steps[0], 0, steps[0] / 2 - 0.5], [0, steps[1], steps[1] / 2 - 0.5]])
        enlarged = cut(picture, to_picture, (rows, columns))
        result = frame.copy()
        result[top:bottom, left:right] = WHITE
        inner = result[top + border : bottom - border, left + border : right - border]
        inner[...] = np.clip(np.rint(enlarged), 0, 255)
        yield result


Frames = Iterator[NDArray[np.uint8]]
RENDERING = "rendering the video"
LOG = logging.getLogger("lipmotion")
FILM = Outputs()  # how a filmed face is shown where nothing is said
ZOOM = 1.3  # how much larger than the speaker's own the mouth over it is


@dataclass(frozen=True, eq=False)
class Film:
    """A video that is made while it is read.

    frames  : each uint8 RGB [shape=(H, W, 3)], of even sizes
    count   : number of the frames
    covered : the part of the frames in which the face, or the inset, is at any time: left, top, right, bottom, px
    """

    frames: Frames
    count: int
    rate_hz: float
    covered: tuple[float, float, float, float]


@limit_threads()
def make_film(  # noqa: PLR0913
    face: FilmedFace,
    motion: Motion,
    *,
    speech: Path | None = None,
    sound: Audio | None = None,
    model: Model | None = None,
    units: Timeline[Unit] | None = None,
    fps: float | None = None,
    options: Outputs = FILM,
) -> Film:
    """Return the video of a filmed face.

    face      : of the person
    motion    : of tracked points of the same person, or eigenlips
    speech    : the video of the speech, for an overlay
    sound     : for a jaw that follows the energy
    model     : that generated the motion; needed where the motion is eigenlips
    units     : the phones in time, of which p, b and m close the lips; None: they are not known
    fps       : frames a second; None, and with an overlay: those of the footage
    Frame n shows the time n / fps; the last one is at or before the end of the motion. Frames are made a few at a time.
    Raises InputError: motion without the channels that the face needs, no sound for ``energy``, a background in which
    there is no face, a rate that is not positive, or an overlay of a sound without video.
    """
    check_film(options, speech)
    eigenlips = model.eigenlips if model is not None else None

    def make_codes(rate_hz: float) -> FaceCodes:  # what the lower face is like in every frame
        time_s = compute_frame_times(len(motion.values), motion.rate_hz, rate_hz)
        codes = predict_codes(face, motion, units or Timeline(()), len(time_s), rate_hz, eigenlips)
        if options.jaw != "energy":
            return codes
        if sound is None:
            raise InputError("a jaw that follows the energy needs the sound; give the recording")
        return face.appearance.with_jaw_of_sound(codes, measure_levels_at(sound, time_s))

    stitching = AS_PRINTED if options.refinement == "paper" else STITCHING
    if options.overlay == "inset" and speech is not None:
        frames, rate_hz = read_video_frames(speech)
        codes = make_codes(rate_hz)
        mouths = Stitcher(face.appearance, stitching).draw_mouths(codes)
        first = next(frames, None)
        if first is None:
            raise InputError(f"{speech}: holds no pictures; give a video as speech")
        height, width = (length // 2 * 2 for length in first.shape[:2])  # a last row or column would make sizes odd
        frames = (frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2] for frame in chain([first], frames))
        covered = place_inset((height, width), face.appearance.mouths.shape[1:3])
        return Film(add_inset(frames, mouths), len(codes), rate_hz, covered)
    if options.overlay is not None and speech is not None:
        background = open_background(speech, in_time=True).enlarge(ZOOM)
    elif options.background is None:
        background = open_stored_background(face.background)
    else:
        background = open_background(Path(options.background), face.appearance)
    rate_hz = background.rate_hz if fps is None or options.overlay is not None else fps
    codes = make_codes(rate_hz)
    has_jaw = options.jaw != "none" and options.overlay is None
    stitcher = Stitcher(face.appearance, replace(stitching, jaw=has_jaw))
    frames = stitcher.stitch(codes, background.decode(len(codes), rate_hz))
    return Film(frames, len(codes), rate_hz, background.face_box)


def predict_codes(
    face: FilmedFace,
    motion: Motion,
    units: Timeline[Unit],
    count: int,
    rate_hz: float,
    eigenlips: Eigenlips | None = None,
) -> FaceCodes:
    """Return the lower face in ``count`` frames at a video's rate. Raises InputError: missing channels."""
    time_s = np.arange(count) / rate_hz
    values, contact = motion.at(time_s), None
    if "opening" in motion.names and np.isfinite(motion.values).all():
        gap = close_lips(read_gap(motion), motion, units)
        gap = sample_pictures(gap, gap == 0, motion.rate_hz, time_s)
        column = motion.column("opening")
        values[:, column] = np.minimum(values[:, column], gap_to_opening(gap))
        contact = 1 - np.clip(gap / FULL_DEFICIT_GAP, 0, 1)  # how near the lips are to touching
    shown = Motion(values, rate_hz, motion.channels)
    if eigenlips is None or not all(channel in shown.channels for channel in eigenlips.channels):
        return face.appearance.predict_codes(shown, contact)
    values = values[:, [shown.column(channel.name) for channel in eigenlips.channels]]
    starts = range(0, count, BATCH)
    parts = [face.appearance.measure_codes(eigenlips.restore(values[start : start + BATCH])) for start in starts]
    mouth = np.concatenate([part.mouth for part in parts])
    if all(channel.unit == GREY for channel in shown.channels):
        jaw, chin_px = (np.concatenate([getattr(part, name) for part in parts]) for name in ("jaw", "chin_px"))
        return FaceCodes(mouth, jaw, chin_px)
    return replace(face.appearance.predict_codes(shown), mouth=mouth, width=None)  # points tell the jaw better


def find_other_person(model: Model, face: FilmedFace, speaker: str = "") -> FilmedFace | None:
    """Return a face if it is of another person than the motion of a model, so that it must be mapped onto it.

    speaker : of the people of the model whose motion is generated
    A face without speech (its footage has no sound) cannot be mapped onto: that is
    logged as a warning, and the motion stays as it is. Raises InputError: as ``is_person_of``.
    """
    if is_person_of(model, face, speaker):
        return None
    if not face.takes:
        LOG.warning(
            "the face was built from footage without sound, so the motion, which is another person's, is not fitted to "
            "it; build it from footage with sound"
        )
        return None
    return face


def is_person_of(model: Model, face: FilmedFace, speaker: str = "") -> bool:
    """Return whether a model generates the motion of the person of a face: they are of one corpus and speaker.

    speaker : of the people of the model whose motion is generated
    The only person of a model is that of a face of the same corpus unless both have names, and these differ.
    Raises InputError: it does not, and generates eigenlips alone, which cannot be mapped onto another person.
    """
    people = model.about.get("speakers") or [""]
    same = bool(set(model.about.get("corpus", ())) & set(face.about.get("corpus", ())))
    filmed = face.about.get("speaker", "")
    same = same and (speaker == filmed if len(people) > 1 else people[0] == filmed or not (people[0] and filmed))
    if not same and model.visual == "eigenlips":
        trained_on = "; ".join(map(str, model.about.get("corpus", ["another corpus"])))
        raise InputError(
            f"the model generates mouth pictures of the person of {trained_on}, the face is that of another; use a "
            "model of tracked points, or train one of eigenlips on this person"
        )
    return same


@limit_threads()
def write_film(
    path: Path, film: Film, sound: Audio, *, mark: Mark = "metadata", monitor: Monitor = silent_monitor
) -> None:
    """Write a video of a filmed face, with sound; whole or not at all.

    film, mark : of ``make_film``, which is read to its end; how the video says that it is synthetic
    Raises InputError: the background cannot be read to its end. Raises ExportError: the file cannot be written, or the
    face leaves no corner for a visible mark.
    """
    frames = with_progress(film.frames, RENDERING, monitor, film.count, REPORT_INTERVAL)
    if mark == "visible":
        frames = mark_frames(frames, film.covered)
    tags, xmp = mark_metadata() if mark != "none" else (None, None)
    write_mp4(path, frames, fps=film.rate_hz, audio=sound, tags=tags, xmp=xmp)


def refuse_film(options: Outputs) -> None:
    """Raise InputError if options are given that only a filmed face has."""
    filmed = {
        "a background": options.background,
        "an overlay": options.overlay,
        "another jaw": options.jaw if options.jaw != FILM.jaw else None,
        "another refinement": options.refinement if options.refinement != FILM.refinement else None,
        "a visible mark": options.mark if options.mark == "visible" else None,
    }
    option = next((name for name, value in filmed.items() if value is not None), None)
    if option is not None:
        raise InputError(f"{option} is for filmed faces; give one: --face FILE.face (docs/filmed-face.md)")


def check_film(options: Outputs, speech: str | Path | None = None) -> None:
    """Raise InputError if options do not go with the speech, a path (None: a sound in no file), before long work."""
    if options.background is not None:
        check_source(Path(options.background), "video")
    if options.overlay is not None and (speech is None or options.background is not None):
        raise InputError("an overlay shows the video of the speech: give a video as speech, and no background")
    if options.overlay is not None and not has_video(Path(str(speech))):
        raise InputError(f"{speech}: has no pictures, and an overlay shows them; give a video as speech")
