"""Transfer onto another face: how near the rest pose and the range of generated motion come to a person's own.

    python benchmarks/transfer.py MODEL CORPUS [--speaker NAME] [--fit half,all,N] [--recogniser auto]

The map is fitted on the first half of the person's utterances (or all, or the first N) and judged on the second half,
or on the same one where there is only one. Every utterance is generated once without and once with the map, of the
same units. Figures, without and with the map: ``rest``, distance of the rest poses in silence away from speech, the
sum of opening, width and outer, and of the points the root mean square; ``range``, the 5th to 95th percentile in
speech relative to the tracked one; ``acc``, mean of per-clip correlations without a lag, of all frames and of speech;
``distance``, the mean absolute difference, the sum of three channels; ``closed``, the share of p, b and m in which
the generated opening is not more than 0.01 over the tracked person's own (the median over p, b and m of the smallest
opening); ``closed_source``: over the generated one's own, before the map.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion import Corpus, Generation, Model, SpeechRequest, load_model
from lipmotion.motion.closure import closable_ranges
from lipmotion.motion.rest import away_from_speech, speech_intervals
from lipmotion.motion.speaker_maps import FAR_FROM_SPEECH_S, NEAR_SPEECH_S, SpeakerMap
from lipmotion.motion.transfer_map import transfer_map
from lipmotion.pipeline.generate import transfer
from lipmotion.pipeline.generate.generation_for import generate_for
from lipmotion.pipeline.understand.understood_speech import understand
from lipmotion.types import Speech, Utterance

CHANNELS = ("opening", "width", "outer")
TOUCH = 0.01
Array = NDArray[np.float64]


def main() -> None:
    """Print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--speaker", default="")
    parser.add_argument("--fit", default="half")
    parser.add_argument("--recogniser", default="auto", help="for the footage that is fitted on")
    parser.add_argument("--no-transcripts", action="store_true", help="in the footage that is fitted on")
    options = parser.parse_args()
    corpus, model = Corpus.open(options.corpus), load_model(options.model)
    names = corpus.names(None, [options.speaker] if options.speaker else [])
    half = (len(names) + 1) // 2
    judged = [corpus.utterance(name) for name in names[half:] or names]
    understood = [understand(model, request_of(utterance)) for utterance in judged]
    for fit in options.fit.split(","):
        count = {"half": half, "all": len(names)}.get(fit) or int(fit)
        start_s = time.perf_counter()
        person = fitted_map(model, [corpus.utterance(name) for name in names[:count]], options)
        fit_s = time.perf_counter() - start_s
        gain = {channel.name: round(float(gain), 3) for channel, gain in zip(person.channels, person.gain, strict=True)}
        about = {"person": options.speaker or corpus.path.name, "fitted": count, "judged": len(judged), "fit_s": fit_s}
        figures = judge(model, person, judged, understood)
        print(json.dumps(about | {"gain": {name: gain[name] for name in CHANNELS}} | figures), flush=True)


def request_of(utterance: Utterance, transcripts: bool = True, recogniser: str = "auto") -> SpeechRequest:
    """Return an utterance as a request, with its words if it has any."""
    words = " ".join(utterance.words) if utterance.words and transcripts else None
    return SpeechRequest(utterance.audio, words, recogniser=recogniser)


def fitted_map(model: Model, utterances: list[Utterance], options: argparse.Namespace) -> SpeakerMap:
    """Return the map of ``map_onto``, of some utterances of a corpus."""
    source, target = [], []
    for utterance in utterances:
        request = request_of(utterance, not options.no_transcripts, options.recogniser)
        pair = transfer.measured_pair(model, None, utterance.name, request, utterance.track, "corpus")
        source.append(pair[0])
        target.append(pair[1])
    return transfer_map(source, target)


def judge(model: Model, person: SpeakerMap, utterances: list[Utterance], understood: list[Speech]) -> dict[str, Any]:
    """Return the figures, each without and with the map."""
    rows: dict[str, list[Any]] = defaultdict(list)
    tracked_closed, closed, spoken = [], defaultdict(list), defaultdict(list)
    for utterance, speech in zip(utterances, understood, strict=True):
        before, after = (generate_for(each, model.engine, model.learned, speech) for each in (None, person))
        seen = utterance.track.seen
        track = utterance.track.motion
        time_s = track.time_s[seen]
        values = {"tracked": track.values[seen]}
        values |= {kind: shown(each, track.names, time_s) for kind, each in (("before", before), ("after", after))}
        speech_s = speech_intervals(before.units)
        quiet = away_from_speech(time_s, speech_s, FAR_FROM_SPEECH_S)
        if quiet.sum() < 3:
            quiet = away_from_speech(time_s, speech_s, NEAR_SPEECH_S)
        loud = ~away_from_speech(time_s, speech_s, 0.0)
        three = [track.names.index(name) for name in CHANNELS]
        points = [n for n, name in enumerate(track.names) if name[:2] in ("x_", "y_", "z_")]
        for kind, curve in values.items():
            spoken[kind].append(curve[loud][:, three])
            if kind == "tracked":
                continue
            rows[f"acc {kind}"].append([np.corrcoef(curve[:, n], values["tracked"][:, n])[0, 1] for n in three])
            rows[f"acc in speech {kind}"].append(
                [np.corrcoef(curve[loud, n], values["tracked"][loud, n])[0, 1] for n in three]
            )
            rows[f"distance {kind}"].append(np.abs(curve - values["tracked"])[:, three].sum(axis=1).mean())
            if quiet.sum() >= 3:
                apart = np.median(curve[quiet], axis=0) - np.median(values["tracked"][quiet], axis=0)
                rows[f"rest {kind}"].append(np.abs(apart[three]).sum())
                rows[f"rest points {kind}"].append(np.sqrt(np.square(apart[points]).mean()) if points else np.nan)
        ranges = closable_ranges(before.units, len(before.motion.values))
        for frames in ranges:
            inside = (time_s >= frames.start / 100 - 0.02) & (time_s <= frames.stop / 100 + 0.01)
            if inside.any():
                tracked_closed.append(values["tracked"][inside, three[0]].min())
                closed["before"].append(before.motion["opening"][frames].min())
                closed["after"].append(after.motion["opening"][frames].min())
    out: dict[str, Any] = {key: np.round(np.mean(rows[key], axis=0), 4).tolist() for key in sorted(rows)}
    wide = {kind: np.ptp(np.percentile(np.concatenate(each), [5, 95], axis=0), axis=0) for kind, each in spoken.items()}
    out |= {f"range {kind}": np.round(wide[kind] / wide["tracked"], 3).tolist() for kind in ("before", "after")}
    own = float(np.median(tracked_closed)) if tracked_closed else float("nan")
    limit = 0.1 * float(np.percentile(np.concatenate(spoken["tracked"])[:, 0], 95))
    source = float(np.median(closed["before"])) if closed["before"] else float("nan")
    out["pbm"] = len(tracked_closed)
    out["tracked_closed"] = round(own, 4)
    out["tracked_share_closed"] = share(tracked_closed, own + TOUCH)
    for kind in ("before", "after"):
        out[f"closed {kind}"] = share(closed[kind], own + TOUCH)
        out[f"closed 10% {kind}"] = share(closed[kind], limit)
    out["closed 10% tracked"] = share(tracked_closed, limit)
    out["closed_source"] = share(closed["before"], source + TOUCH)
    return out


def share(values: list[float], limit: float) -> float:
    """Return the share of values that are not more than a limit."""
    return round(float(np.mean(np.array(values) <= limit)), 3) if values else float("nan")


def shown(generation: Generation, names: tuple[str, ...], time_s: Array) -> Array:
    """Return the generated values of some channels at some times [shape=(len(time_s), len(names))]."""
    return generation.selected(names).motion.at(time_s)


if __name__ == "__main__":
    main()
