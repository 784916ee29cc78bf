"""One long video is one corpus: it is divided into utterances at pauses and cuts, and between lines of a transcript."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.folder import VIDEO_KINDS
from lipmotion.corpora.layouts import LRS
from lipmotion.corpora.source_recordings import RecordingFolder, SourceRecording
from lipmotion.corpora.splits import LISTS
from lipmotion.errors import InputError
from lipmotion.formats.label_files import labels_beside
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import levels_db, quietest_s, spoken_spans
from lipmotion.storage.media import open_media, stated_duration_s, video_streams
from lipmotion.types import Audio, Monitor, Progress, TimedTranscript, TranscriptLine
from lipmotion.units.written_forms import list_readings
from lipmotion_faces.corpus.separate_sound import on_own_time, separate_sound
from lipmotion_faces.corpus.utterance_spans import SpokenPart, utterance_spans
from lipmotion_faces.tracking.video_scan import VideoScan, scan_video


def transcript_beside(video: Path) -> TimedTranscript | None:
    """Return the transcript beside a video, one with times if there is any; None if there is none.

    Raises InputError: a file of labels cannot be read.
    """
    transcript = labels_beside(video).transcript
    if transcript is None or transcript.has_times:
        return transcript
    other = labels_beside(video, ignored=frozenset({video.with_suffix(".txt")})).transcript
    return other if other is not None and other.has_times else transcript


def spoken_lines(transcript: TimedTranscript) -> list[SpokenPart]:
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
            following = next((start_s for start_s in starts_s[n + 1 :] if start_s is not None), None)
            parts += _whole_line(line, following)
    return parts


def _whole_line(line: TranscriptLine, following_s: float | None) -> list[SpokenPart]:
    end_s = following_s if line.end_s is None else line.end_s
    if line.start_s is None or end_s is None or end_s <= line.start_s or not line.words:
        return []
    return [SpokenPart(line.start_s, end_s, tuple(said for word in line.words for said in list_readings(word.word)[0]))]


LOG = logging.getLogger("lipmotion")

_STAGE = "dividing long videos"
"""Name of the stage in reports of progress."""
DIVIDING_SHARE = 0.2
"""Share of the whole preparation that this takes, for reports of progress."""
VIDEO = "one video"
DIVIDED_KINDS = (*VIDEO_KINDS, VIDEO, LRS)
"""Kinds of recordings of which the long ones are divided; GRID's and others hold a sentence each."""
LONG_S = 30.0
"""Videos that state a longer duration are divided; a shorter one is one utterance."""
LEAST_SPLIT_UTTERANCES = 10
"""A single video with fewer utterances is all for training."""
HELD_OUT_SHARE = 0.1
"""Share of the utterances, the last ones, that are ``test``; as many before them are ``val``."""


@dataclass(frozen=True, eq=False)
class VideoPart:
    """One utterance of a long video.

    sound  : its sound
    person : thumbnails of the face that is to be followed; none where nobody else is in the video
    """

    recording: SourceRecording
    sound: Audio
    person: tuple[NDArray[np.float64], ...]


def single_video(path: Path) -> RecordingFolder:
    """Return the folder of recordings that one video is. Raises InputError: labels beside it cannot be read."""
    return RecordingFolder(VIDEO, (SourceRecording(path.stem, path, labels_beside(path).words),))


def with_long_videos_divided(
    folder: RecordingFolder, place: Path, monitor: Monitor, tracker: str
) -> tuple[RecordingFolder, dict[str, VideoPart]]:
    """Return the folder with the parts of long videos in their place, and those parts by name.

    place   : the folder itself, where lists of splits may lie
    tracker : name of the tracker that finds faces
    Of a single video, without lists, the last parts become ``val`` and ``test``; others have the split of the whole.
    """
    videos = [item for item in folder.recordings if folder.kind in DIVIDED_KINDS and _is_long_video(item)]
    if not videos:
        return folder, {}
    is_only_one = len(folder.recordings) == 1 and not any((place / name).is_file() for name in LISTS)
    recordings = [item for item in folder.recordings if item not in videos]
    problems, parts = dict(folder.problems), dict[str, VideoPart]()
    for n, item in enumerate(videos):
        reached = partial(_report_share, monitor, n, len(videos))
        reached(0.0)
        try:
            found = divided(item, reached, tracker, splits_by_time=is_only_one)
        except InputError as error:
            problems[item.name] = str(error)
            continue
        if not found:
            problems[item.name] = f"{item.file}: no speech in it; give a video in which somebody talks"
        parts |= {part.recording.name: part for part in found}
    recordings += [part.recording for part in parts.values()]
    recordings.sort(key=lambda recording: recording.name)
    return RecordingFolder(f"{folder.kind}, divided into utterances", tuple(recordings), problems), parts


def _report_share(monitor: Monitor, before: int, count: int, share: float) -> None:
    monitor(Progress(_STAGE, before, count, DIVIDING_SHARE * (before + share) / count))


def _is_long_video(recording: SourceRecording) -> bool:
    """Return whether a recording is a video that states more than ``LONG_S``; False if it cannot be read."""
    import av

    if recording.motion_file is not None:
        return False
    try:
        with open_media(recording.file) as container:
            stream = next(iter(video_streams(container)), None)
            return stream is not None and stated_duration_s(container, stream) > LONG_S
    except (av.FFmpegError, ValueError, OSError):
        return False


def divided(
    recording: SourceRecording, reached: Callable[[float], None], tracker: str, *, splits_by_time: bool
) -> list[VideoPart]:
    """Return the utterances of a long video; each is named after its start (``talk-00h01m12.48s``).

    reached        : called now and then with the share of the video that was looked at
    tracker        : name of the tracker that finds faces
    splits_by_time : give the last utterances to ``val`` and ``test``
    Words are those of the lines in time beside the video; without such lines, the utterances have none.
    Memory: the whole sound (230 MB for an hour), but not the pictures. Raises InputError: it cannot be read.
    """
    scan = scan_video(recording.file, reached, tracker)
    for note in scan.damage:
        LOG.warning("%s: %s", recording.file, note)
    audio = _sound_of(recording)
    levels = levels_db(audio)
    parts = _lines(recording) or [SpokenPart(*span) for span in spoken_spans(levels)]
    end_s = min(audio.duration_s, scan.end_s)
    spans = utterance_spans(_within(parts, end_s), scan.cuts_s.tolist(), end_s, partial(quietest_s, levels))
    spans = [span for longer in spans if (span := _on_pictures(longer, scan, end_s)).duration_s > 0]
    splits = _splits(len(spans), recording.split) if splits_by_time else [recording.split] * len(spans)
    return [
        VideoPart(_recording_of(span, recording, split), _sound(audio, span), scan.person)
        for span, split in zip(spans, splits, strict=True)
    ]


def _sound_of(recording: SourceRecording) -> Audio:
    """Return the sound of a video: its recorder's, brought into step, or its own."""
    separate = separate_sound(recording)
    if separate is None:
        return read_audio(recording.file)
    LOG.info("%s: %s", recording.file, separate.note)
    return on_own_time(separate, read_audio(recording.file).duration_s)


def _lines(recording: SourceRecording) -> list[SpokenPart]:
    """Return the lines in time beside a video, with a warning where there are words without times."""
    transcript = transcript_beside(recording.file)
    lines = [] if transcript is None else spoken_lines(transcript)
    if transcript is not None and not lines:
        LOG.warning(
            "%s: its transcript has no times, so it is not known what is said in which part; the parts have no "
            "transcript. Give one with times: subtitles, labels, or what a recogniser writes",
            recording.file,
        )
    return lines


def _within(stretches: Sequence[SpokenPart], end_s: float) -> list[SpokenPart]:
    return [replace(part, end_s=min(part.end_s, end_s)) for part in stretches if part.start_s < end_s]


def _on_pictures(span: SpokenPart, scan: VideoScan, end_s: float) -> SpokenPart:
    """Return a span that begins and ends at the times of pictures, none later than before; the last at the very end."""
    first, last = np.searchsorted(scan.times_s, [span.start_s + 1e-6, span.end_s + 1e-6], side="right") - 1
    is_last = span.end_s >= end_s - 1e-6
    return replace(
        span,
        start_s=float(scan.times_s[max(first, 0)]),
        end_s=end_s if is_last else float(scan.times_s[max(last, 0)]),
    )


def _splits(count: int, split: str) -> list[str]:
    """Return the splits of utterances in order of time."""
    held_out = round(HELD_OUT_SHARE * count) if count >= LEAST_SPLIT_UTTERANCES else 0
    return [split] * (count - 2 * held_out) + ["val"] * held_out + ["test"] * held_out


def _recording_of(part: SpokenPart, recording: SourceRecording, split: str) -> SourceRecording:
    minutes, seconds = divmod(round(part.start_s, 2), 60)
    name = f"{recording.name}-{int(minutes) // 60:02}h{int(minutes) % 60:02}m{seconds:05.2f}s"
    return replace(
        recording, name=name, words=part.words, split=split, phones=None, start_s=part.start_s, end_s=part.end_s
    )


def _sound(audio: Audio, part: SpokenPart) -> Audio:
    first, last = (round(time_s * audio.rate_hz) for time_s in (part.start_s, part.end_s))
    return Audio(audio.samples[first:last], audio.rate_hz)
