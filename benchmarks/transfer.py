"""Transfer onto another face: how near the rest pose and the range of generated motion come to a person's own.

    python benchmarks/transfer.py PERSON ... [--model MODEL] [--tracks FOLDER]

A person is a video, which is divided at pauses into pieces of 5 s or more, or a folder of videos, each of them a piece;
of a video that is one piece, each half is one. Maps are fitted on one piece, each in turn, on two, and on half of them,
ten times drawn, and judged on all others. One JSON object a line for each person and number of pieces, at last the
means over people. Figures, each without and with the map: ``rest``, distance of the rest poses in silence away from
speech, the sum of opening, width and outer; ``distance``, the mean absolute difference, the sum of the three;
``range``, the 5th to 95th percentile of the opening in speech relative to the tracked one; ``closed``, the share of
p, b and m in which the opening is not more than 0.01 over the person's own (the median over p, b and m).
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from kept_tracks import kept_track
from numpy.typing import NDArray

from lipmotion import Model, Request, load_model
from lipmotion.motion.closure import OPENING, closable_ranges
from lipmotion.motion.rest import away_from_speech, speech_intervals
from lipmotion.motion.speaker_maps import FAR_FROM_SPEECH_S, RANGE_PERCENTILES, SpeakerMap, restfulness
from lipmotion.motion.transfer_map import transfer_map
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import levels_db, spoken_spans
from lipmotion.types import FRAME_RATE_HZ, Audio, Example, Track
from lipmotion_faces.transfer import measured_pair

CHANNELS = (OPENING, "width", "outer")
PIECE_S, DRAWS, TOUCH, LEAST_SILENCE = 5.0, 10, 0.01, 8
Pair = tuple[Example, Example]
Array = NDArray[np.float64]


def main() -> None:
    """Print one JSON object for each person and number of pieces."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("people", type=Path, nargs="+")
    parser.add_argument("--model", type=Path, help="default: the one that ships")
    parser.add_argument("--tracks", type=Path, help="folder in which tracks are kept")
    options = parser.parse_args()
    model = load_model(options.model) if options.model else load_model()
    means: dict[str, list[Array]] = defaultdict(list)
    for path in options.people:
        pairs = [pair for one in recordings(path, options.tracks) for pair in pairs_of(model, *one)]
        if len(pairs) == 1:
            pairs = halves(pairs[0])
        for name, fits in choices(len(pairs)).items():
            rows = [judged(pairs, fit) for fit in fits]
            found = np.nanmean([row for each in rows for row in each], axis=0)
            means[name].append(found)
            show(path.stem, name, len(pairs), found)
    for name, each in means.items():
        show("all", name, len(each), np.nanmean(each, axis=0))


def show(person: str, fitted: str, number: int, figures: Array) -> None:
    """Print the means of the rows of ``judged``."""
    names = ("rest", "distance", "range", "closed")
    named = {name: row.round(3).tolist() for name, row in zip(names, figures, strict=True)}
    print(json.dumps({"person": person, "pieces": number, "fitted on": fitted} | named), flush=True)


def choices(count: int) -> dict[str, list[list[int]]]:
    """Return the choices of pieces to fit on, by the name of their number."""
    draw = np.random.default_rng(0)
    found = {"one": [[number] for number in range(count)]}
    for name, size in (("two", 2), ("half", count // 2)):
        if count >= 4:
            found[name] = [draw.permutation(count)[:size].tolist() for _ in range(DRAWS)]
    return found


def recordings(path: Path, tracks: Path | None) -> Iterator[tuple[Audio, Track]]:
    """Yield the pieces of a person's recordings."""
    if path.is_dir():
        for file in sorted(each for each in path.iterdir() if each.suffix == ".mkv"):
            yield read_audio(file), kept_track(file, tracks)
        return
    audio, track = read_audio(path), kept_track(path, tracks)
    rate_hz = track.motion.rate_hz
    for first, last in pairwise(round(cut_s * rate_hz) for cut_s in cuts_at_pauses(audio)):
        samples = slice(round(first / rate_hz * audio.rate_hz), round(last / rate_hz * audio.rate_hz))
        motion = replace(track.motion, values=track.motion.values[first:last])
        yield Audio(audio.samples[samples], audio.rate_hz), Track(motion, np.asarray(track.seen)[first:last])


def cuts_at_pauses(audio: Audio) -> list[float]:
    """Return where the pieces of a recording begin, and where the last one ends, in seconds."""
    cuts_s = [0.0]
    for (_, end_s), (start_s, _) in pairwise(spoken_spans(levels_db(audio))):
        middle_s = (end_s + start_s) / 2
        if middle_s - cuts_s[-1] >= PIECE_S and audio.duration_s - middle_s >= PIECE_S:
            cuts_s.append(middle_s)
    return [*cuts_s, audio.duration_s]


def pairs_of(model: Model, audio: Audio, track: Track) -> list[Pair]:
    """Return what a model generates for a piece, and the person's own motion."""
    return [measured_pair(model, None, "piece", Request(audio), track, "the video")]


def halves(pair: Pair) -> list[Pair]:
    """Return a piece twice, each with another half of the frames valid."""
    later = np.arange(len(pair[0].valid)) >= len(pair[0].valid) // 2
    return [
        (replace(pair[0], valid=pair[0].valid & half), replace(pair[1], valid=pair[1].valid & half))
        for half in (~later, later)
    ]


def judged(pairs: Sequence[Pair], fit: Sequence[int]) -> list[Array]:
    """Return the figures, without and with a map fitted on some pieces, of each of the others [each shape=(4, 2)]."""
    person = transfer_map([pairs[number][0] for number in fit], [pairs[number][1] for number in fit])
    closed = own_closed([own for _, own in pairs])
    others = [pair for number, pair in enumerate(pairs) if number not in fit]
    return [np.stack([figures(pair, None, closed), figures(pair, person, closed)], axis=1) for pair in others]


def figures(pair: Pair, person: SpeakerMap | None, closed: float) -> Array:
    """Return the figures of a piece [shape=(4,)]; NaN where there is no silence, or no p, b or m."""
    source, own = pair
    names = source.motion.names
    values, tracked = np.asarray(source.motion.values, float), np.asarray(own.motion.values, float)
    if person is not None:
        values = person.to_person(values, restfulness(source.speech.units, len(values)))
    three = [names.index(name) for name in CHANNELS]
    values, tracked = values[:, three], tracked[:, three]
    values[:, 0] = np.maximum(values[:, 0], 0)
    time_s, speech_s = np.arange(len(values)) / FRAME_RATE_HZ, speech_intervals(source.speech.units)
    silent = own.valid & away_from_speech(time_s, speech_s, FAR_FROM_SPEECH_S)
    rest = np.nan
    if silent.sum() >= LEAST_SILENCE:
        rest = float(np.abs(np.median(values[silent], axis=0) - np.median(tracked[silent], axis=0)).sum())
    spoken = own.valid & ~away_from_speech(time_s, speech_s, 0.0)
    wide = [np.ptp(np.percentile(each[spoken, 0], RANGE_PERCENTILES)) for each in (values, tracked)]
    lips = [values[frames, 0].min() for frames in measured_closures(own)]
    shut = float(np.mean(np.array(lips) <= closed + TOUCH)) if lips else np.nan
    return np.array([rest, np.abs(values - tracked)[own.valid].sum(axis=1).mean(), wide[0] / wide[1], shut])


def measured_closures(own: Example) -> list[slice]:
    """Return the frames of each p, b and m that were measured."""
    ranges = closable_ranges(own.speech.units, len(own.valid))
    return [frames for frames in ranges if own.valid[frames].all()]


def own_closed(measured: Sequence[Example]) -> float:
    """Return a person's opening in p, b and m: the median of the smallest."""
    return float(
        np.median([own.motion[OPENING][frames].min() for own in measured for frames in measured_closures(own)])
    )


if __name__ == "__main__":
    main()
