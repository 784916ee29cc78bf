"""Live rivals and our stream on the same recordings: correlation of the lips' opening, paired intervals, p b m.

    PYTHONPATH=src:benchmarks python extras/league/compare.py --work FOLDER --corpus GRID_S1 --corpora FOLDER
        --open FOLDER --tracks FOLDER --profile profile.bin --openfacefx PYTHON

A rival gives weights. What of the opening each of them is, how late, and the rival's settings are learned and chosen on
``val`` of the corpus: least squares, with the best constant lag within the look-ahead.
"""

import argparse
import itertools
import json
import subprocess
from pathlib import Path

import numpy as np
from anyone import kept_track, pieces
from scipy.io import wavfile
from scipy.signal import resample_poly

from lipmotion import Corpus, Stream, animate, load_model
from lipmotion.corpora.folder import spell_name
from lipmotion.pipeline.request import Request
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio
from lipmotion.units import VOWELS

RATE_HZ = 48_000
HERE = Path(__file__).parent
LOOK_AHEADS, BACK_MS, STEP_MS = (80, 160), -60, 20
LOUD, LOUD_SHARE, WINDOW = 0.1, 95, RATE_HZ // 50
"""Rivals have thresholds: the root mean square of the loudest twentieth of each recording is brought to this."""
RIDGE = 1e-3
DRAWS = 2_000
LIMITS_S = {"s1": 0.0, "strangers": 0.06, "open": 0.12}
SHUT, NEAR_S = 0.012, 0.04
TOLD = ("openfacefx",)
"""Rivals that hear nothing, and are told phones; ours is told them, too."""
SETTINGS = {
    "headaudio": {
        "mends_aa": (False, True), "speakerMeanHz": (150, 200),
        ("vadMode", "vadGateActiveDb", "vadGateInactiveDb"):
            ((1, -40, -50), (1, -50, -60), (1, -60, -70)),
    },
    "wlipsync": {
        ("minVolume", "maxVolume"): ((-2.5, -1.5), (-3.0, -1.5), (-3.5, -1.5), (-2.5, -1.0), (-3.0, -1.0)),
        "smoothness": (0.0125, 0.025, 0.05, 0.1),
    },
    "openfacefx": {"look_ahead": (0.08, 0.16, 0.5, 4.5), "causal_smooth": (0.0, 0.03), "closure_floor": (0.9,)},
}  # fmt: skip
"""What is tried of each rival, all with all."""


def main() -> None:
    """Print what was chosen, and one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("work", "corpus", "corpora", "open", "tracks", "profile", "openfacefx"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--only", nargs="*", choices=list(SETTINGS), default=list(SETTINGS))
    options = parser.parse_args()
    sets = collect(options)
    everything = tuple(each for group in sets.values() for each in group)
    told = tuple(each for each in everything if each.phones)
    for rival in options.only:
        heard = told if rival in TOLD else everything
        groups = {name: group for name, group in sets.items() if group[0] in heard}
        tried = [
            (settings, ask(rival, sets["val"], settings, options)) for settings in list_settings(rival, options.profile)
        ]
        for ahead_ms in LOOK_AHEADS:
            settings, lag_s, coefficients, found = choose(tried, sets["val"], ahead_ms)
            show(rival=rival, ahead_ms=ahead_ms, settings=settings, lag_ms=round(1000 * lag_s), val=found)
            answers = ask(rival, heard, settings, options)
            theirs = {each: (times - lag_s, weights @ coefficients) for each, (times, weights) in answers.items()}
            ours = {each: stream(each, ahead_ms, rival in TOLD, options.work) for each in heard}
            for name, group in groups.items():
                limit_s = LIMITS_S.get(name, 0.0)
                both = [round(score(pairs(group, each, limit_s), not limit_s), 3) for each in (ours, theirs)]
                show(group=name, ours=both[0], theirs=both[1], more=interval(group, ours, theirs, limit_s))
            show(closures=closures(sets, ours, theirs))


class Recording:
    """A recording with the tracked opening of its speaker.

    words : what is said; None: it is not known, and so are the phones
    """

    def __init__(self, name, audio, tracked, words, work):
        self.name, self.audio, self.phones = name, audio, list_phones(name, audio, words, work)
        self.time_s, self.opening = tracked.motion.time_s[tracked.seen], tracked.motion["opening"][tracked.seen]


def collect(options) -> dict[str, list[Recording]]:
    """Return the recordings by group."""
    corpus = Corpus.open(options.corpus)
    sets: dict[str, list[Recording]] = {}
    for group, split in (("val", "val"), ("s1", "test")):
        clips = [corpus.utterance(name) for name in corpus.names(split)[:25]]
        sets[group] = [
            Recording(each.name, each.audio, each.track, " ".join(each.words), options.work) for each in clips
        ]
    others = sorted((options.corpora / "grid-others").glob("*.mpg"))
    sets["strangers"] = [
        Recording(each.stem, read_audio(each), kept_track(each, options.tracks),
                  " ".join(spell_name(each.stem) or ()), options.work)
        for each in others
    ]  # fmt: skip
    videos = sorted(options.open.glob("*.mp4"))
    whole = [piece for path in videos for piece in pieces(path, options.tracks, whole=True)]
    sets["open"] = [Recording(name, audio, tracked, None, options.work) for name, audio, tracked in whole]
    return sets


def list_phones(name: str, audio: Audio, words: str | None, work: Path) -> list[tuple[str, float, float]]:
    """Return the phones in time, aligned; "" is silence. None of them where the words are not known."""
    if words is None:
        return []
    kept = work / f"{name}.phones.json"
    if not kept.exists():
        units = animate(Request(audio, transcript=words), model=load_model()).units
        rows = [(each.label.phone.replace("sil", "").replace("sp", ""), each.start_s, each.end_s) for each in units]
        kept.write_text(json.dumps(rows), encoding="utf-8")
    return json.loads(kept.read_text(encoding="utf-8"))


def ask(rival, recordings, settings, options):
    """Return times and weights, with a constant, of each recording, by an adapter in its own environment."""
    rows = []
    for each in recordings:
        sound = options.work / f"{each.name}.wav"
        if not sound.exists():
            samples = resample_poly(each.audio.samples, RATE_HZ, each.audio.rate_hz)
            powers = np.square(samples[: len(samples) // WINDOW * WINDOW]).reshape(-1, WINDOW).mean(axis=1)
            samples *= LOUD / np.sqrt(np.percentile(powers, LOUD_SHARE))
            wavfile.write(sound, RATE_HZ, np.rint(np.clip(samples, -1, 1) * 32767).astype(np.int16))
        rows.append({"name": each.name, "sound": str(sound), "phones": each.phones})
    job, answer = (options.work / f"{rival}-{part}.json" for part in ("job", "answer"))
    job.write_text(json.dumps({"rate_hz": RATE_HZ, "recordings": rows, "settings": settings}), encoding="utf-8")
    program = [options.openfacefx, HERE / "openfacefx_stream.py"] if rival in TOLD else ["node", HERE / f"{rival}.mjs"]
    subprocess.run([*program, job, answer], check=True)
    found = json.loads(answer.read_text(encoding="utf-8"))

    def with_constant(weights):
        return np.stack([*weights.values(), np.ones(len(next(iter(weights.values()))))], axis=1)

    return {
        each: (np.array(found[each.name]["times"]), with_constant(found[each.name]["weights"])) for each in recordings
    }


def choose(tried, recordings, ahead_ms):
    """Return the settings, lag and coefficients with the highest correlation on recordings, and that correlation.

    tried : settings, and what ``ask`` returned with them
    """
    best = ({}, 0.0, np.zeros(0), -1.0)
    for settings, answers in tried:
        for lag_ms in range(BACK_MS, ahead_ms + 1, STEP_MS):
            coefficients = fit(recordings, answers, lag_ms / 1000)
            moved = {each: (times - lag_ms / 1000, rows @ coefficients) for each, (times, rows) in answers.items()}
            found = score(pairs(recordings, moved, 0.0), True)
            if found > best[-1] + 1e-4:
                best = settings, lag_ms / 1000, coefficients, round(found, 4)
    return best


def list_settings(rival, profile):
    """Return all settings of a rival that are tried."""
    tried = []
    for values in itertools.product(*SETTINGS[rival].values()):
        settings = {"profile": str(profile)} if rival == "wlipsync" else {}
        for name, value in zip(SETTINGS[rival], values, strict=True):
            settings |= {name: value} if isinstance(name, str) else dict(zip(name, value, strict=True))
        tried.append(settings)
    return tried


def fit(recordings, answers, lag_s):
    """Return how much of the opening each weight is, by least squares."""
    rows, openings = [], []
    for each in recordings:
        times, weights = answers[each]
        rows.append(at(each.time_s + lag_s, times, weights))
        openings.append(each.opening)
    table, wanted = np.concatenate(rows), np.concatenate(openings)
    square = table.T @ table
    return np.linalg.solve(square + RIDGE * np.trace(square) / len(square) * np.eye(len(square)), table.T @ wanted)


def at(time_s, times, weights):
    """Return weights at some times."""
    return np.stack([np.interp(time_s, times, column) for column in weights.T], axis=1)


def stream(recording, ahead_ms, told, work):
    """Return times and opening of our stream, which are kept; ``told``: it is given the phones."""
    kept = work / f"{recording.name}-{ahead_ms}-{'told' if told else 'heard'}.npy"
    if not kept.exists():
        live = Stream(recording.audio.rate_hz, ahead_ms, load_model(), pauses="natural", seed=None)
        if told:
            live.add_phones(recording.phones)
        frames = live.push(recording.audio.samples) + live.flush()
        np.save(kept, [[frame.time_s for frame in frames], [frame["opening"] for frame in frames]])
    return np.load(kept)


def pairs(group, openings, limit_s):
    """Return generated and tracked opening of each recording, at the lag within a limit that is best for it."""
    found = []
    for each in group:
        lags = np.arange(-limit_s, limit_s + 1e-9, 0.01)
        moved = [np.interp(each.time_s + lag, *openings[each]) for lag in lags]
        found.append((max(moved, key=lambda values: np.corrcoef(values, each.opening)[0, 1]), each.opening))
    return found


def score(found, pooled):
    """Return the correlation over all frames, or the mean over recordings."""
    if pooled:
        return float(np.corrcoef(*(np.concatenate(side) for side in zip(*found, strict=True)))[0, 1])
    return float(np.mean([np.corrcoef(*pair)[0, 1] for pair in found]))


def interval(group, ours, theirs, limit_s):
    """Return the 95 % interval of what ours has more, by the paired bootstrap over recordings."""
    both = [pairs(group, openings, limit_s) for openings in (ours, theirs)]
    draws = np.random.default_rng(0).integers(len(group), size=(DRAWS, len(group)))
    more = [
        score([both[0][n] for n in draw], not limit_s) - score([both[1][n] for n in draw], not limit_s)
        for draw in draws
    ]
    return np.round(np.quantile(more, [0.025, 0.975]), 3).tolist()


def closures(sets, ours, theirs):
    """Return the share of p b m in which the lips come under a threshold, and of vowels whose middle does.

    Ours has its own threshold; theirs is the one under which as many vowels of ``val`` are shut as of ours.
    """
    shut = np.mean(lowest(sets["val"], ours)[1] < SHUT)
    limit = float(np.quantile(lowest(sets["val"], theirs)[1], shut))
    shares = {}
    for name in ("val", "s1", "strangers"):
        group = sets[name]
        for who, openings, threshold in (("ours", ours, SHUT), ("theirs", theirs, limit)):
            lips, vowels = lowest(group, openings)
            shares[name, who] = [round(float(np.mean(each < threshold)), 3) for each in (lips, vowels)] + [len(lips)]
    return {" ".join(key): value for key, value in shares.items()}


def lowest(group, openings):
    """Return the least opening about each p b m, and the opening in the middle of each vowel."""
    lips, vowels = [], []
    for each in group:
        for phone, start_s, end_s in each.phones:
            if phone in ("p", "b", "m"):
                times = np.linspace(start_s - NEAR_S, end_s + NEAR_S, 20)
                lips.append(np.interp(times, *openings[each]).min())
            elif phone in VOWELS:
                vowels.append(np.interp((start_s + end_s) / 2, *openings[each]))
    return np.array(lips), np.array(vowels)


def show(**values):
    """Print one figure."""
    print(json.dumps(values), flush=True)


if __name__ == "__main__":
    main()
