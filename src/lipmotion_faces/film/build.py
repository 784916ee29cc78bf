"""Building of a filmed face, ``build_face(footage) → face``: which recordings are used, and what is learned."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import MANIFEST, Corpus, read_entry
from lipmotion.errors import CorpusError, InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.workers import open_workers, process_count
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import QUIETEST_DB
from lipmotion.stats.pca import choose_evenly
from lipmotion.storage.sources import check_source, hash_file
from lipmotion.types import Audio, Item, Monitor, Progress, silent_monitor
from lipmotion_faces.appearance import lower_face
from lipmotion_faces.appearance.person import FootagePictures, learn_appearance, measure_levels_at
from lipmotion_faces.appearance.placing import cut
from lipmotion_faces.corpus.folder import discover
from lipmotion_faces.corpus.source_recordings import SourceRecording, filter_videos
from lipmotion_faces.film.background import find_best_background, find_chin
from lipmotion_faces.filmed.face import FilmedFace, SpokenTake
from lipmotion_faces.tracking.damaged_pictures import describe_damage, find_damaged
from lipmotion_faces.tracking.frames import VideoSpan, read_stated_duration
from lipmotion_faces.tracking.track import UNSEEN_LIMIT, Footage, decode_footage, track_footage

MAX_FOOTAGE_S = 240.0
"""Seconds of footage that are used, spread evenly over all recordings: of 500 candidates few are new after that."""
LONG_S = 10.0  # shorter recordings are used whole; of longer ones the beginning is used, at least this much
MAX_MEASURED_RECORDINGS = 240  # most recordings whose durations are read
RIGHTS = ("licence", "attribution")  # what is kept of the rights of a recording


@dataclass(frozen=True)
class Take:
    """One recording of a person."""

    name: str
    file: Path
    span: VideoSpan
    collection: str  # the folder that it is in, by its last two names
    speaker: str  # name of the person; empty where it is not known
    rights: tuple[tuple[str, str], ...]  # licence and attribution, where known


def choose_takes(source: Path, recordings: Path | None = None, speaker: str = "") -> list[Take]:
    """Return recordings of one person, about ``MAX_FOOTAGE_S`` in all, spread evenly; long ones are shortened first.

    source     : a video (its beginning is used); a folder of recordings; or a prepared corpus (its training list)
    A take that cannot be read may be among them: where it is tracked, the reason is reported.
    Raises InputError: no such file, several people, no such person, no videos, or a corpus without ``recordings``.
    """
    if not source.exists():
        raise InputError(f"{source}: no such file or folder; give a video of the person, or a folder of videos")
    if source.is_file():
        check_source(source, "video")
        recording = SourceRecording(source.stem, source, None, speaker=speaker)
        return [_make_take(recording, source.parent, seconds=MAX_FOOTAGE_S)]
    if (source / MANIFEST).is_file():
        takes = _list_corpus(Corpus.open(source), recordings, speaker)
    else:
        folder = [item for item in discover(source).recordings if item.motion_file is None]
        items = _select_person(folder, speaker, str(source))
        takes = [_make_take(item, source) for item in [item for item in items if item.split == "train"] or items]
    if not takes:
        raise InputError(f"{source}: no videos in it; give a video of the person, or a folder of videos")
    measured = [takes[index] for index in choose_evenly(MAX_MEASURED_RECORDINGS, len(takes))]
    durations_s = [
        take.span.end_s - take.span.start_s if take.span.end_s < inf else read_stated_duration(take.file) or LONG_S
        for take in measured
    ]
    longest_s = left_s = MAX_FOOTAGE_S
    for number, duration_s in enumerate(sorted(durations_s)):
        share_s = left_s / (len(durations_s) - number)
        if duration_s > share_s:  # all of them have MAX_FOOTAGE_S together
            longest_s = max(share_s, LONG_S)
            break
        left_s -= duration_s
    mean_s = sum(min(duration_s, longest_s) for duration_s in durations_s) / len(durations_s)
    chosen = choose_evenly(ceil(MAX_FOOTAGE_S / max(mean_s, 0.1) - 1e-6), len(takes))
    used = [takes[index] for index in chosen]
    if max(durations_s) <= longest_s:
        return used
    firsts = ((take, take.span.start_s + longest_s) for take in used)
    return [replace(take, span=replace(take.span, end_s=min(take.span.end_s, end_s))) for take, end_s in firsts]


def _select_person(items: Sequence[SourceRecording], speaker: str, where: str) -> list[SourceRecording]:
    """Return the recordings of one person. Raises InputError: there are several people, or no such person."""
    people = sorted({item.speaker for item in items})
    if (speaker and speaker not in people) or (not speaker and len(people) > 1):
        problem = f"no speaker {speaker!r}" if speaker else f"{len(people)} speakers"
        known = ", ".join(name or "one without a name" for name in people)
        raise InputError(f"{where}: {problem}, a face is that of one person; name it (--speaker): {known}")
    return [item for item in items if not speaker or item.speaker == speaker]


def _list_corpus(corpus: Corpus, recordings: Path | None, speaker: str) -> list[Take]:
    if recordings is None:
        raise InputError(
            f"{corpus.path}: a corpus holds the pictures of mouths, but not of faces; name the folder of its videos "
            "as well: --recordings FOLDER"
        )
    if not recordings.is_dir():
        raise InputError(f"{recordings}: no such folder; give the one of the videos of the corpus")
    files: dict[str, list[Path]] = {}
    for path in filter_videos(recordings.rglob("*")):
        files.setdefault(path.name, []).append(path)
    items, collections = [], {}
    for name in corpus.names("train") or corpus.names():
        entry = read_entry(corpus.folder(name))
        stated = entry["source"]
        size, known = stated.get("bytes"), files.get(str(stated.get("file", "")), [])
        same = [file for file in known if size is None or str(file.stat().st_size) == str(size)]
        if len(same) > 1 and "sha256" in stated:  # people of a corpus may share names of files
            same = [file for file in same if hash_file(file) == stated["sha256"]]
        if not same:
            continue
        rights = {key: str(stated[key]) for key in RIGHTS if key in stated}
        start_s, end_s = float(stated.get("start_s", 0.0)), stated.get("end_s")
        item = SourceRecording(name, same[0], None, rights=rights, speaker=str(entry.get("speaker", "")))
        items.append(replace(item, start_s=start_s, end_s=None if end_s is None else float(end_s)))
        collections[name] = str(stated.get("collection", ""))
    if not items:
        raise InputError(f"{recordings}: holds none of the videos of {corpus.path}; give the folder that they are in")
    chosen = _select_person(items, speaker, str(corpus.path))
    return [_make_take(item, recordings, collections[item.name]) for item in chosen]


def _make_take(item: SourceRecording, folder: Path, collection: str | None = None, seconds: float = inf) -> Take:
    end_s = inf if item.end_s is None else item.end_s
    named = "/".join(folder.resolve().parts[-2:]).strip("/") if collection is None else collection
    rights = tuple(sorted((key, value) for key, value in item.rights.items() if key in RIGHTS))
    span = VideoSpan(item.start_s, min(end_s, item.start_s + seconds))
    return Take(item.name, item.file, span, named, item.speaker, rights)


LOG = logging.getLogger("lipmotion")

MIN_FOOTAGE_S = 10.0  # shorter footage is refused: of 3 s the pictures are wrong (docs/results/video.md)
GOOD_FOOTAGE_S = 60.0  # shorter footage is warned about
MAX_PICTURES_HZ = 30.0  # every second frame, or fewer, of faster video is learned from
SPOKEN_TAKES_S = 20.0  # seconds of speech that are kept, for motion of other people's models
MIN_SPOKEN_S = 0.5  # shorter parts of a take are not kept for that
JAW_ENDS = ("x_150", "x_379")  # the ends of the tracked jaw line, right and left
UNUSED_AXIS = "z_"  # channels of depth are not used: they are guesses of the tracker, and differ most between people


@dataclass(frozen=True, eq=False)
class _Filmed:
    """One take: where the face is, pictures of used frames [shape=(n, 128, 128, 3)], and its sound."""

    footage: Footage
    used: NDArray[np.intp]
    pictures: NDArray[np.uint8]
    sound: Audio | None


@limit_threads()
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
    Raises InputError: no such footage, several people, or less than ``MIN_FOOTAGE_S`` with the face.
    Raises MissingDependencyError: OpenCV or MediaPipe is not installed.
    Source: Xie & Liu 2007, §5, §6.

    >>> import lipmotion
    >>> face = lipmotion.build_face("anna.mp4")  # doctest: +SKIP
    >>> lipmotion.save_face(face, "anna.face")  # doctest: +SKIP
    """
    source, processes = Path(source), process_count(workers)
    takes = choose_takes(source, None if recordings is None else Path(recordings), speaker)
    filmed = _film_all(takes, processes, monitor)
    seconds = sum(len(take.used) / take.footage.rate_hz * _step(take.footage) for take in filmed)
    if seconds < MIN_FOOTAGE_S:
        raise InputError(
            f"{source}: {seconds:.1f} s of footage with the face, required {MIN_FOOTAGE_S:.0f} s or more, "
            f"{GOOD_FOOTAGE_S:.0f} s of varied speech for good pictures; give a longer video, or a folder of several"
        )
    if seconds < GOOD_FOOTAGE_S:
        wish = f"with {GOOD_FOOTAGE_S:.0f} s of varied speech the mouth would be truer"
        LOG.warning("%s: %.1f s of footage with the face; %s", source, seconds, wish)
    monitor(Progress("learning the face", 0, 1, 0.6))
    appearance = learn_appearance(_gather_pictures(filmed))
    monitor(Progress("choosing the background", 0, 1, 0.9))
    background = find_best_background([take.footage for take in filmed])
    about = {
        "name": name or takes[0].speaker or source.stem,
        "corpus": sorted({take.collection for take in takes}),
        "speaker": takes[0].speaker,
        "footage_s": round(seconds, 1),
        "recordings": len(filmed),
    }
    for key in RIGHTS:
        stated = sorted({dict(take.rights)[key] for take in takes if key in dict(take.rights)})
        about |= {key: stated} if stated else {}
    monitor(Progress("choosing the background", 1, 1, 1.0))
    return FilmedFace(appearance, background, select_speech(filmed), about)


def _film_all(takes: Sequence[Take], workers: int, monitor: Monitor) -> list[_Filmed]:
    """Return all takes that show the person whom most takes show; others are reported. Raises InputError: none."""
    filmed: list[_Filmed] = []
    problems: list[str] = []
    with open_workers(min(workers, len(takes))) as team:
        for number, result in enumerate(team.ordered_map(_film, takes)):
            monitor(Progress("tracking the face", number + 1, len(takes), 0.6 * (number + 1) / len(takes)))
            if isinstance(result, str):
                problems.append(result)
                monitor(Item(takes[number].name, "skipped", result))
            else:
                filmed.append(result)
    if not filmed:
        raise InputError(f"none of {len(takes)} recordings can be used; the first: {problems[0]}")
    signatures = np.stack([lower_face.find_signature(take.pictures) for take in filmed])
    alike = signatures @ signatures.T
    person = int((alike >= lower_face.SAME_PERSON_LIKENESS).sum(axis=1).argmax())
    of_person = []
    for take, value in zip(filmed, alike[person].tolist(), strict=True):
        if value >= lower_face.SAME_PERSON_LIKENESS:
            of_person.append(take)
            continue
        wanted = lower_face.SAME_PERSON_LIKENESS
        reason = f"shows another face than most recordings (likeness {value:.2f}, required {wanted})"
        monitor(Item(take.footage.path.name, "skipped", reason))
    of_person = _leave_out_damaged(of_person, monitor)
    sizes = sorted({take.footage.size for take in of_person})
    if len(sizes) > 1:
        LOG.warning("the recordings have pictures of %d sizes; the background is one of them", len(sizes))
    return of_person


def _leave_out_damaged(filmed: Sequence[_Filmed], monitor: Monitor) -> list[_Filmed]:
    """Return takes without damaged pictures; those with too many are reported. Raises InputError: none is left."""
    seen, (rows, columns) = [np.ones(len(take.used), bool) for take in filmed], lower_face.find_mouth_part(1)
    mouths = [partial(np.asarray, take.pictures[:, rows, columns]) for take in filmed]
    result = []
    rates = [take.footage.rate_hz / _step(take.footage) for take in filmed]
    for take, damage in zip(filmed, find_damaged(mouths, seen, rates), strict=True):
        footage, wrong = take.footage, np.any(list(damage.values()), axis=0)
        if not wrong.any():
            result.append(take)
            continue
        noted = "; ".join(describe_damage(damage, take.used / footage.rate_hz))
        right, step = np.array(footage.track.seen), _step(footage)
        for frame in take.used[wrong]:
            right[frame : frame + step] = False
        is_left_out = wrong.mean() > UNSEEN_LIMIT
        monitor(Item(footage.path.name, "skipped" if is_left_out else "prepared", noted))
        if not is_left_out:
            without = replace(footage, track=replace(footage.track, seen=right), damaged=footage.track.seen & ~right)
            result.append(replace(take, footage=without, used=take.used[~wrong], pictures=take.pictures[~wrong]))
    if not result:
        raise InputError(f"all {len(filmed)} recordings are damaged; give others")
    return result


def _film(take: Take) -> _Filmed | str:
    """Return a take, tracked; or the reason why it cannot be used."""
    try:
        footage = track_footage(take.file, take.span)
        used = np.flatnonzero(footage.track.seen)[:: _step(footage)]
        pictures = _cut_lower_faces(footage, used, 1)
        sound = read_take_sound(take)
    except (InputError, CorpusError) as error:
        return str(error)
    return _Filmed(footage, used, pictures, sound)


def read_take_sound(take: Take) -> Audio | None:
    """Return the sound of a take; None if the video has none, or only silence."""
    try:
        audio = read_audio(take.file, warn=False)
    except InputError:
        return None
    first = round(take.span.start_s * audio.rate_hz)
    last = len(audio.samples) if np.isinf(take.span.end_s) else round(take.span.end_s * audio.rate_hz)
    part = audio.samples[first:last]
    return Audio(part, audio.rate_hz) if len(part) and part.any() else None


def _step(footage: Footage) -> int:
    """Return how many frames of a video there are for each that is learned from."""
    return max(1, int(np.ceil(footage.rate_hz / MAX_PICTURES_HZ - 1e-6)))


def _cut_lower_faces(footage: Footage, frames: NDArray[np.intp], scale: int) -> NDArray[np.uint8]:
    """Return pictures of the lower face in some frames, rising [shape=(n, 128 · scale, 128 · scale, 3)]."""
    size = lower_face.HEIGHT * scale, lower_face.WIDTH * scale
    maps = lower_face.map_region(footage.face_to_image, scale)
    result = np.empty((len(frames), *size, 3), np.uint8)
    if not len(frames):
        return result
    wanted, first = iter(enumerate(frames.tolist())), int(frames[0])
    row, number = next(wanted)
    for n, image in enumerate(decode_footage(footage, first, int(frames[-1]) + 1), first):
        if n == number:
            result[row] = np.clip(np.rint(cut(image, maps[n], size)), 0, 255)
            row, number = next(wanted, (row, -1))
    return result


def _gather_pictures(filmed: Sequence[_Filmed]) -> FootagePictures:
    motion = np.concatenate([np.asarray(take.footage.track.motion.values)[take.used] for take in filmed])
    channels = filmed[0].footage.track.motion.channels
    used = [n for n, channel in enumerate(channels) if not channel.name.startswith(UNUSED_AXIS)]
    names = [channel.name for channel in channels]
    right, left = (motion[:, names.index(name)] for name in JAW_ENDS)
    chin = np.concatenate([find_chin(take.footage)[take.used] for take in filmed])
    maps = np.concatenate([take.footage.face_to_image[take.used] for take in filmed])
    scale = lower_face.choose_scale(maps)
    starts = np.cumsum([0, *(len(take.used) for take in filmed)])
    levels = [
        np.full(len(take.used), QUIETEST_DB)
        if take.sound is None
        else measure_levels_at(take.sound, take.used / take.footage.rate_hz)
        for take in filmed
    ]

    def read_finer(numbers: NDArray[np.intp]) -> NDArray[np.uint8]:
        parts = []
        for take, start in zip(filmed, starts, strict=False):
            inside = numbers[(numbers >= start) & (numbers < start + len(take.used))] - start
            if len(inside):
                parts.append(_cut_lower_faces(take.footage, take.used[inside], scale))
        return np.concatenate(parts)

    return FootagePictures(
        tuple(take.pictures for take in filmed),
        motion[:, used],
        tuple(channels[n] for n in used),
        np.concatenate(levels),
        chin,
        lower_face.measure_shape(float(np.median(left - right)) / 2, chin),
        scale,
        read_finer,
    )


def select_speech(filmed: Sequence[_Filmed]) -> tuple[SpokenTake, ...]:
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
