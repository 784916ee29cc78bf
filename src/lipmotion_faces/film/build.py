"""Building of a filmed face: ``build_face(footage) → face``."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.kernels.threads import one_thread
from lipmotion.pipeline.workers import process_count, worker_pool
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import QUIETEST_DB, levels_db_at
from lipmotion.types import Audio, Item, Monitor, Progress, silent_monitor
from lipmotion_faces.appearance.identity import SAME_PERSON_LIKENESS, face_signature
from lipmotion_faces.appearance.lower_face import HEIGHT, WIDTH, best_scale, face_shape, region_map
from lipmotion_faces.appearance.person import FootagePictures, learn_appearance
from lipmotion_faces.appearance.placing import cut
from lipmotion_faces.film.background import best_background, chin_px
from lipmotion_faces.film.takes import Take, takes_of
from lipmotion_faces.filmed.face import FilmedFace, SpokenTake
from lipmotion_faces.tracking.footage import Footage, footage_frames, track_footage

LOG = logging.getLogger("lipmotion")

LEAST_FOOTAGE_S = 10.0
"""Shorter footage is refused: of 3 s the pictures are wrong (docs/results/video.md)."""
GOOD_FOOTAGE_S = 60.0
"""Shorter footage is warned about."""
MOST_PICTURES_HZ = 30.0
"""Every second frame, or fewer, of faster video is learned from."""
SPOKEN_TAKES_S = 20.0
"""Seconds of speech that are kept, for motion of other people's models."""
MIN_SPOKEN_S = 0.5
"""Shorter parts of a take are not kept for that."""
JAW_ENDS = ("x_150", "x_379")
"""The ends of the tracked jaw line, right and left."""
UNUSED_AXIS = "z_"
"""Channels of depth are not used: they are guesses of the tracker, and differ most between people."""


@dataclass(frozen=True, eq=False)
class _Filmed:
    """One take: where the face is, its pictures, and its sound.

    used     : frames that are learned from, rising
    pictures : of the lower face in these frames [shape=(n, 128, 128, 3)]
    sound    : None if there is none
    """

    footage: Footage
    used: NDArray[np.intp]
    pictures: NDArray[np.uint8]
    sound: Audio | None


@one_thread()
def build_face(
    source: str | Path,
    *,
    recordings: str | Path | None = None,
    speaker: str = "",
    name: str = "",
    workers: int | None = None,
    monitor: Monitor = silent_monitor,
) -> FilmedFace:
    """Return the face of a person, learned from footage.

    source     : a video of the person speaking, a folder of videos, or a prepared corpus; of folders and corpora the
                 training list. About four minutes are used: of one video the first ones, of several spread evenly
    recordings : of a corpus, the folder of the videos that it was prepared from
    speaker    : whose face, where there are several people
    name       : of the face; empty: the speaker's, or the file's
    workers    : number of processes; None: one a core. With more than one, a script must be guarded by
                 ``if __name__ == "__main__":``
    monitor    : receives reports of the progress
    Raises InputError: no such footage, several people, or less than ``LEAST_FOOTAGE_S`` with the face.
    Raises MissingDependencyError: OpenCV or MediaPipe is not installed.
    Source: Xie & Liu 2007, §5, §6.

    >>> import lipmotion
    >>> face = lipmotion.build_face("anna.mp4")  # doctest: +SKIP
    >>> lipmotion.save_face(face, "anna.face")  # doctest: +SKIP
    """
    source, processes = Path(source), process_count(workers)
    takes = takes_of(source, None if recordings is None else Path(recordings), speaker)
    filmed = _filmed(takes, processes, monitor)
    seconds = sum(len(take.used) / take.footage.rate_hz * _step(take.footage) for take in filmed)
    if seconds < LEAST_FOOTAGE_S:
        raise InputError(
            f"{source}: {seconds:.1f} s of footage with the face, required {LEAST_FOOTAGE_S:.0f} s or more, "
            f"{GOOD_FOOTAGE_S:.0f} s of varied speech for good pictures; give a longer video, or a folder of several"
        )
    if seconds < GOOD_FOOTAGE_S:
        LOG.warning(
            "%s: %.1f s of footage with the face; with %.0f s of varied speech the mouth would be truer",
            source,
            seconds,
            GOOD_FOOTAGE_S,
        )
    monitor(Progress("learning the face", 0, 1, 0.6))
    appearance = learn_appearance(_pictures(filmed))
    monitor(Progress("choosing the background", 0, 1, 0.9))
    background = best_background([take.footage for take in filmed])
    about = {
        "name": name or takes[0].speaker or source.stem,
        "corpus": sorted({take.collection for take in takes}),
        "speaker": takes[0].speaker,
        "footage_s": round(seconds, 1),
        "recordings": len(filmed),
    }
    for key in ("licence", "attribution"):
        stated = sorted({dict(take.rights)[key] for take in takes if key in dict(take.rights)})
        about |= {key: stated} if stated else {}
    monitor(Progress("choosing the background", 1, 1, 1.0))
    return FilmedFace(appearance, background, _spoken(filmed), about)


def _filmed(takes: Sequence[Take], workers: int, monitor: Monitor) -> list[_Filmed]:
    """Return all takes in which the face is found. Raises InputError: there are none."""
    found: list[_Filmed] = []
    problems: list[str] = []
    with worker_pool(min(workers, len(takes))) as team:
        for number, result in enumerate(team.ordered_map(_film, takes)):
            monitor(Progress("tracking the face", number + 1, len(takes), 0.6 * (number + 1) / len(takes)))
            if isinstance(result, str):
                problems.append(result)
                monitor(Item(takes[number].name, "skipped", result))
            else:
                found.append(result)
    if not found:
        raise InputError(f"none of {len(takes)} recordings can be used; the first: {problems[0]}")
    found = _of_one_person(found, monitor)
    sizes = sorted({take.footage.size for take in found})
    if len(sizes) > 1:
        LOG.warning("the recordings have pictures of %d sizes; the background is one of them", len(sizes))
    return found


def _of_one_person(filmed: Sequence[_Filmed], monitor: Monitor) -> list[_Filmed]:
    """Return the takes that show the person whom most takes show; the others are reported, and left out."""
    signatures = np.stack([face_signature(take.pictures) for take in filmed])
    alike = signatures @ signatures.T
    person = int((alike >= SAME_PERSON_LIKENESS).sum(axis=1).argmax())
    kept = []
    for take, value in zip(filmed, alike[person].tolist(), strict=True):
        if value >= SAME_PERSON_LIKENESS:
            kept.append(take)
            continue
        reason = f"shows another face than most recordings (likeness {value:.2f}, required {SAME_PERSON_LIKENESS})"
        monitor(Item(take.footage.path.name, "skipped", reason))
    return kept


def _film(take: Take) -> _Filmed | str:
    """Return a take, tracked; or the reason why it cannot be used."""
    try:
        footage = track_footage(take.file, take.span)
        used = np.flatnonzero(footage.track.seen)[:: _step(footage)]
        pictures = _lower_faces(footage, used, 1)
        sound = _sound(take)
    except (InputError, CorpusError) as error:
        return str(error)
    return _Filmed(footage, used, pictures, sound)


def _sound(take: Take) -> Audio | None:
    """Return the sound of a take; None if the video has none, or only silence."""
    try:
        whole = read_audio(take.file, warn=False)
    except InputError:
        return None
    first = round(take.span.start_s * whole.rate_hz)
    last = len(whole.samples) if np.isinf(take.span.end_s) else round(take.span.end_s * whole.rate_hz)
    part = whole.samples[first:last]
    return Audio(part, whole.rate_hz) if len(part) and part.any() else None


def _step(footage: Footage) -> int:
    """Return how many frames of a video there are for each that is learned from."""
    return max(1, int(np.ceil(footage.rate_hz / MOST_PICTURES_HZ - 1e-6)))


def _lower_faces(footage: Footage, frames: NDArray[np.intp], scale: int) -> NDArray[np.uint8]:
    """Return pictures of the lower face in some frames, rising [shape=(n, 128 · scale, 128 · scale, 3)]."""
    size = HEIGHT * scale, WIDTH * scale
    maps = region_map(footage.face_to_image, scale)
    result = np.empty((len(frames), *size, 3), np.uint8)
    if not len(frames):
        return result
    wanted, first = iter(enumerate(frames.tolist())), int(frames[0])
    row, number = next(wanted)
    for n, image in enumerate(footage_frames(footage, first, int(frames[-1]) + 1), first):
        if n == number:
            result[row] = np.clip(np.rint(cut(image, maps[n], size)), 0, 255)
            row, number = next(wanted, (row, -1))
    return result


def _pictures(filmed: Sequence[_Filmed]) -> FootagePictures:
    values = [np.asarray(take.footage.track.motion.values)[take.used] for take in filmed]
    motion = np.concatenate(values)
    channels = filmed[0].footage.track.motion.channels
    used = [n for n, channel in enumerate(channels) if not channel.name.startswith(UNUSED_AXIS)]
    names = [channel.name for channel in channels]
    right, left = (motion[:, names.index(name)] for name in JAW_ENDS)
    chin = np.concatenate([chin_px(take.footage)[take.used] for take in filmed])
    maps = np.concatenate([take.footage.face_to_image[take.used] for take in filmed])
    scale = best_scale(maps)
    starts = np.cumsum([0, *(len(take.used) for take in filmed)])
    return FootagePictures(
        tuple(take.pictures for take in filmed),
        motion[:, used],
        tuple(channels[n] for n in used),
        np.concatenate([_levels(take) for take in filmed]),
        chin,
        face_shape(float(np.median(left - right)) / 2, chin),
        scale,
        partial(_finer, filmed, starts, scale),
    )


def _finer(
    filmed: Sequence[_Filmed], starts: NDArray[np.intp], scale: int, numbers: NDArray[np.intp]
) -> NDArray[np.uint8]:
    """Return pictures of some of the frames of all takes, rising, with ``scale`` samples a pixel."""
    parts = []
    for take, start in zip(filmed, starts, strict=False):
        inside = numbers[(numbers >= start) & (numbers < start + len(take.used))] - start
        if len(inside):
            parts.append(_lower_faces(take.footage, take.used[inside], scale))
    return np.concatenate(parts)


def _levels(take: _Filmed) -> NDArray[np.float64]:
    """Return the level of the sound at the frames that are used, dB [shape=(n,)]."""
    if take.sound is None:
        return np.full(len(take.used), QUIETEST_DB)
    return levels_db_at(take.sound, take.used / take.footage.rate_hz)


def _spoken(filmed: Sequence[_Filmed]) -> tuple[SpokenTake, ...]:
    """Return the first ``SPOKEN_TAKES_S`` of the takes with sound, and their motion; none where no take has sound."""
    takes: list[SpokenTake] = []
    left_s = SPOKEN_TAKES_S
    for take in filmed:
        if take.sound is None or min(left_s, take.sound.duration_s) < MIN_SPOKEN_S:
            continue
        footage = take.footage
        count = min(len(footage), round(left_s * footage.rate_hz))
        sound = Audio(take.sound.samples[: round(left_s * take.sound.rate_hz)], take.sound.rate_hz)
        motion = footage.track.motion
        part = type(motion)(np.asarray(motion.values)[:count], motion.rate_hz, motion.channels)
        takes.append(SpokenTake(sound, part, np.asarray(footage.track.seen[:count])))
        left_s -= count / footage.rate_hz
    return tuple(takes)
