"""One long video is one corpus: it is divided into utterances at pauses and cuts, and between lines of a transcript."""

from __future__ import annotations

import logging
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.formats.label_files import find_labels
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import STEP_S, list_spans, measure_levels_db
from lipmotion.types import Audio, Monitor, Progress, TimedTranscript
from lipmotion.units.written_forms import list_readings
from lipmotion_faces.corpus.folder import LRS, VIDEO_KINDS
from lipmotion_faces.corpus.source_recordings import LISTS, RecordingFolder, SourceRecording
from lipmotion_faces.corpus.supplied import align_sound, separate_sound
from lipmotion_faces.tracking.frames import read_stated_duration
from lipmotion_faces.tracking.track import VideoScan, scan_video

SHORTEST_S, LONGEST_S = 3.0, 12.0
"""Wanted length of an utterance. Longer ones are divided at their longest pause, shorter ones joined where they can."""
MIN_S = 0.8  # shorter pieces are left out
LONGEST_PAUSE_S = 1.0  # a longer pause always divides, and is left out except for its edges
MARGIN_S = 0.3  # silence kept before and after an utterance, at most half of the pause: lips begin before the sound
ROUNDING_S = 0.05  # a cut that is this close to the end of a stretch does not divide it

Quietest = Callable[[float, float], float]  # returns the time of the lowest level between two times


@dataclass(frozen=True)
class SpokenPart:
    """A part of a recording without a pause, from start to end in seconds; words: what is said, None if not known."""

    start_s: float
    end_s: float
    words: tuple[str, ...] | None = None

    @property
    def duration_s(self) -> float:
        """Duration in seconds."""
        return self.end_s - self.start_s


def find_utterances(
    stretches: Sequence[SpokenPart], cuts_s: Sequence[float], duration_s: float, quietest: Quietest
) -> list[SpokenPart]:
    """Return the utterances of a recording, in order, without overlap.

    stretches  : parts with speech, in order; those with words are never divided
    cuts_s     : times at which the camera changes, rising; utterances without words are divided there
    quietest   : finds the best place to divide where there is no pause
    Between neighbours, the pause is shared; of one longer than twice ``MARGIN_S``, the middle belongs to nobody.
    """
    groups: list[list[SpokenPart]] = []
    for stretch in _separate_overlaps(stretches):
        edges = [stretch.start_s, stretch.end_s]
        if stretch.words is None:
            edges[1:1] = [t for t in cuts_s if stretch.start_s + ROUNDING_S < t < stretch.end_s - ROUNDING_S]
        for start_s, end_s in pairwise(edges):
            for part in _divide_speech(replace(stretch, start_s=start_s, end_s=end_s), quietest):
                before = groups[-1][-1] if groups else None
                is_pause = before is not None and part.start_s - before.end_s <= LONGEST_PAUSE_S
                if before is not None and is_pause and not _is_cut_between(before, part, cuts_s):
                    groups[-1].append(part)
                else:
                    groups.append([part])
    pieces: list[SpokenPart] = []
    for piece in (_join(parts) for group in groups for parts in _divide(group)):
        before = pieces[-1] if pieces else None
        if (
            before is not None
            and min(before.duration_s, piece.duration_s) < SHORTEST_S
            and piece.end_s - before.start_s <= LONGEST_S
            and piece.start_s - before.end_s <= LONGEST_PAUSE_S
            and not _is_cut_between(before, piece, cuts_s)
        ):
            pieces[-1] = _join([before, piece])
        else:
            pieces.append(piece)
    wanted = [piece for piece in pieces if piece.duration_s >= MIN_S]
    return _add_margins(wanted, cuts_s, duration_s, quietest)


def _separate_overlaps(stretches: Sequence[SpokenPart]) -> list[SpokenPart]:
    """Return stretches without overlap: lines of a transcript may be shown together, or a little too long."""
    ordered: list[SpokenPart] = []
    for stretch in sorted(stretches, key=lambda stretch: stretch.start_s):
        if ordered and stretch.start_s < ordered[-1].end_s:
            border_s = max(ordered[-1].start_s, stretch.start_s)
            ordered[-1] = replace(ordered[-1], end_s=border_s)
        ordered.append(stretch)
    return ordered


def _divide_speech(stretch: SpokenPart, quietest: Quietest) -> list[SpokenPart]:
    """Return the parts of a stretch that is too long, divided where it is quietest in its middle third."""
    if stretch.words is not None or stretch.duration_s <= LONGEST_S:
        return [stretch]
    third = stretch.duration_s / 3
    border_s = quietest(stretch.start_s + third, stretch.end_s - third)
    halves = replace(stretch, end_s=border_s), replace(stretch, start_s=border_s)
    return [part for half in halves for part in _divide_speech(half, quietest)]


def _is_cut_between(before: SpokenPart, after: SpokenPart, cuts_s: Sequence[float]) -> bool:
    following = bisect_left(cuts_s, before.end_s - ROUNDING_S)
    return following < len(cuts_s) and cuts_s[following] <= after.start_s + ROUNDING_S


def _join(parts: Sequence[SpokenPart]) -> SpokenPart:
    words = [word for part in parts for word in part.words or ()]
    return SpokenPart(parts[0].start_s, parts[-1].end_s, tuple(words) if parts[0].words is not None else None)


def _divide(group: list[SpokenPart]) -> list[list[SpokenPart]]:
    """Return the parts of a group, none longer than ``LONGEST_S`` unless it is one stretch."""
    if len(group) < 2 or group[-1].end_s - group[0].start_s <= LONGEST_S:
        return [group]
    middle_s = (group[0].start_s + group[-1].end_s) / 2

    def rate(n: int) -> tuple[bool, float]:
        is_long = min(group[n - 1].end_s - group[0].start_s, group[-1].end_s - group[n].start_s) >= SHORTEST_S
        pause_s = group[n].start_s - group[n - 1].end_s
        return is_long, pause_s if is_long else -abs(group[n].start_s - middle_s)

    at = max(range(1, len(group)), key=rate)
    return _divide(group[:at]) + _divide(group[at:])


def _add_margins(
    pieces: list[SpokenPart], cuts_s: Sequence[float], duration_s: float, quietest: Quietest
) -> list[SpokenPart]:
    """Return the pieces with silence at both ends, not beyond a neighbour, a cut or the recording."""
    result: list[SpokenPart] = []
    for n, piece in enumerate(pieces):
        border_s = result[-1].end_s if result else 0.0
        end_s = min(piece.end_s + MARGIN_S, duration_s)
        if n + 1 < len(pieces) and pieces[n + 1].start_s - piece.end_s < 2 * MARGIN_S:
            low_s, high_s = piece.end_s, pieces[n + 1].start_s
            if piece.words is not None:  # lines begin and end late or early
                low_s, high_s = low_s - MARGIN_S / 2, high_s + MARGIN_S / 2
            end_s = quietest(low_s, high_s) if high_s > low_s else low_s
        start_s = max(piece.start_s - MARGIN_S, border_s)
        if result and piece.start_s - pieces[n - 1].end_s < 2 * MARGIN_S:
            start_s = border_s
        middle_s = (piece.start_s + piece.end_s) / 2
        near = [t for t in cuts_s if start_s <= t <= end_s]
        if piece.words is None:
            start_s = max([start_s, *(t for t in near if t <= middle_s)])
            end_s = min([end_s, *(t for t in near if t > middle_s)])
        result.append(replace(piece, start_s=start_s, end_s=end_s))
    return result


LOG = logging.getLogger("lipmotion")

_STAGE = "dividing long videos"
DIVIDING_SHARE = 0.2  # share of the whole preparation that this takes, for reports of progress
VIDEO = "one video"
DIVIDED_KINDS = (*VIDEO_KINDS, VIDEO, LRS)
"""Kinds of recordings of which the long ones are divided; GRID's and others hold a sentence each."""
LONG_S = 30.0  # videos that state a longer duration are divided; a shorter one is one utterance
MIN_SPLIT_UTTERANCES = 10  # a single video with fewer utterances is all for training
HELD_OUT_SHARE = 0.1  # share of the utterances, the last ones, that are ``test``; as many before them are ``val``


def find_transcript(video: Path) -> TimedTranscript | None:
    """Return the transcript beside a video, best one with times; None: none. Raises InputError: unreadable labels."""
    transcript = find_labels(video).transcript
    if transcript is None or transcript.has_times:
        return transcript
    other = find_labels(video, ignored=frozenset({video.with_suffix(".txt")})).transcript
    return other if other is not None and other.has_times else transcript


def list_spoken_lines(transcript: TimedTranscript) -> list[SpokenPart]:
    """Return the lines of a transcript as parts, in order; of a line whose words all have times, the words.

    A line without an end lasts to the next one that has a start; lines without a start are left out. Numbers
    are read as they usually are.
    """
    starts_s = [line.start_s for line in transcript.lines]
    parts: list[SpokenPart] = []
    for n, line in enumerate(transcript.lines):
        words = [
            SpokenPart(word.start_s, word.end_s, list_readings(word.word)[0])
            for word in line.words
            if word.start_s is not None and word.end_s is not None and word.end_s > word.start_s
        ]
        if len(words) == len(line.words):
            parts += words
        else:
            following_s = next((start_s for start_s in starts_s[n + 1 :] if start_s is not None), None)
            end_s = following_s if line.end_s is None else line.end_s
            if line.start_s is not None and end_s is not None and end_s > line.start_s and line.words:
                text = tuple(spoken for word in line.words for spoken in list_readings(word.word)[0])
                parts.append(SpokenPart(line.start_s, end_s, text))
    return parts


@dataclass(frozen=True, eq=False)
class VideoPart:
    """One utterance of a long video: its sound, and thumbnails of the face to follow (none where there is no other)."""

    recording: SourceRecording
    sound: Audio
    person: tuple[NDArray[np.float64], ...]


def wrap_video(path: Path) -> RecordingFolder:
    """Return the folder of recordings that one video is. Raises InputError: labels beside it cannot be read."""
    return RecordingFolder(VIDEO, (SourceRecording(path.stem, path, find_labels(path).words),))


def divide_long_videos(
    folder: RecordingFolder, place: Path, monitor: Monitor, tracker: str
) -> tuple[RecordingFolder, dict[str, VideoPart]]:
    """Return the folder with the parts of long videos in their place, and those parts by name.

    place   : the folder itself, where lists of splits may lie
    Of a single video, without lists, the last parts become ``val`` and ``test``; others have the split of the whole.
    """
    candidates = [item for item in folder.recordings if folder.kind in DIVIDED_KINDS and item.motion_file is None]
    videos = [item for item in candidates if read_stated_duration(item.file) > LONG_S]
    if not videos:
        return folder, {}
    is_only_one = len(folder.recordings) == 1 and not any((place / name).is_file() for name in LISTS)
    recordings = [item for item in folder.recordings if item not in videos]
    problems, parts = dict(folder.problems), dict[str, VideoPart]()
    for n, item in enumerate(videos):

        def report(share: float, before: int = n) -> None:
            monitor(Progress(_STAGE, before, len(videos), DIVIDING_SHARE * (before + share) / len(videos)))

        report(0.0)
        try:
            of_video = divide_video(item, report, tracker, splits_by_time=is_only_one)
        except InputError as error:
            problems[item.name] = str(error)
            continue
        if not of_video:
            problems[item.name] = f"{item.file}: no speech in it; give a video in which somebody talks"
        parts |= {part.recording.name: part for part in of_video}
    recordings += [part.recording for part in parts.values()]
    recordings.sort(key=lambda recording: recording.name)
    return RecordingFolder(f"{folder.kind}, divided into utterances", tuple(recordings), problems), parts


def divide_video(
    recording: SourceRecording, reached: Callable[[float], None], tracker: str, *, splits_by_time: bool
) -> list[VideoPart]:
    """Return the utterances of a long video; each is named after its start (``talk-00h01m12.48s``).

    reached        : called now and then with the share of the video that was looked at
    splits_by_time : give the last utterances to ``val`` and ``test``
    Words are those of the lines in time beside the video; without such lines, the utterances have none.
    Memory: the whole sound (230 MB for an hour), but not the pictures. Raises InputError: it cannot be read.
    """
    scan = scan_video(recording.file, reached, tracker)
    for note in scan.damage:
        LOG.warning("%s: %s", recording.file, note)
    audio, separate = read_audio(recording.file), separate_sound(recording)
    if separate is not None:
        LOG.info("%s: %s", recording.file, separate.note)
        audio = align_sound(separate, audio.duration_s)
    levels = measure_levels_db(audio)
    transcript = find_transcript(recording.file)
    lines = [] if transcript is None else list_spoken_lines(transcript)
    if transcript is not None and not lines:
        LOG.warning(
            "%s: its transcript has no times, so it is not known what is said in which part; the parts have no "
            "transcript. Give one with times: subtitles, labels, or what a recogniser writes",
            recording.file,
        )
    parts = lines or [SpokenPart(*span) for span in list_spans(levels)]
    end_s = min(audio.duration_s, scan.end_s)
    parts = [replace(part, end_s=min(part.end_s, end_s)) for part in parts if part.start_s < end_s]
    spans = find_utterances(parts, scan.cuts_s.tolist(), end_s, partial(find_quietest, levels))
    spans = [span for longer in spans if (span := _fit_to_pictures(longer, scan, end_s)).duration_s > 0]
    held_out = 0
    if splits_by_time and len(spans) >= MIN_SPLIT_UTTERANCES:
        held_out = round(HELD_OUT_SHARE * len(spans))
    splits = [recording.split] * (len(spans) - 2 * held_out) + ["val"] * held_out + ["test"] * held_out
    result = []
    for span, split in zip(spans, splits, strict=True):
        minutes, seconds = divmod(round(span.start_s, 2), 60)
        name = f"{recording.name}-{int(minutes) // 60:02}h{int(minutes) % 60:02}m{seconds:05.2f}s"
        described = replace(recording, name=name, words=span.words, split=split, phones=None)
        described = replace(described, start_s=span.start_s, end_s=span.end_s)
        first, last = round(span.start_s * audio.rate_hz), round(span.end_s * audio.rate_hz)
        result.append(VideoPart(described, Audio(audio.samples[first:last], audio.rate_hz), scan.person))
    return result


def _fit_to_pictures(span: SpokenPart, scan: VideoScan, end_s: float) -> SpokenPart:
    """Return a span that begins and ends at the times of pictures, none later than before; the last at the very end."""
    first, last = np.searchsorted(scan.times_s, [span.start_s + 1e-6, span.end_s + 1e-6], side="right") - 1
    is_last = span.end_s >= end_s - 1e-6
    start_s, before_s = float(scan.times_s[max(first, 0)]), float(scan.times_s[max(last, 0)])
    return replace(span, start_s=start_s, end_s=end_s if is_last else before_s)


def find_quietest(levels: NDArray[np.float64], start_s: float, end_s: float) -> float:
    """Return the time of the lowest level from ``start_s`` to ``end_s``; their middle if no frame lies between."""
    first, last = round(start_s / STEP_S), round(end_s / STEP_S)
    part = levels[max(first, 0) : max(last, 0)]
    if not part.size:
        return (start_s + end_s) / 2
    return (max(first, 0) + int(np.argmin(part)) + 0.5) * STEP_S
