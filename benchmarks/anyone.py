"""Anyone's voice, any words, any room: accuracy of a model outside the training speaker's quiet studio.

    python benchmarks/anyone.py [--model FILE] [--split val] [--open FOLDER] [--tracks FOLDER]
        [--only rooms|strangers|phones|open] [--live MS] [--pauses natural|rest]

rooms     : clips of the corpus of ``--corpus`` in babble, white noise, a room, over a telephone; ACC of opening, pooled
strangers : GRID clips of other speakers, audio only and with transcript; mean ACC per clip, best lag within 60 ms
phones    : ``speech-open`` with transcripts: mean opening and width by phone, and their rank correlation with the table
open      : recordings with a face of ``--open`` (docs/results/voices.md), in pieces of 5 s or ``--whole``; mean
            ACC per clip, best lag within 120 ms
With ``--live``, what a stream makes of the sound alone with so much look-ahead, instead of ``animate``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from robust import SPOKEN
from scipy.signal import butter, fftconvolve, sosfilt
from scipy.stats import spearmanr

from lipmotion import Corpus, Stream, animate, load_model
from lipmotion.live.network import STEP_S
from lipmotion.motion.articulation import read_articulation_table
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.speech.sound.acoustic_conditions import mix_noise
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Channel, Motion, Track
from lipmotion_faces.corpus.folder import spell_name
from lipmotion_faces.tracking.track import track

RATE_HZ = 16_000
CHANNELS = ("opening", "width", "outer")
BABBLE = ("61-70968-0000.flac", "acoustic_corpus.wav", "13697_11991_000000.opus", "arctic_a0009.wav",
          "sense_and_sensibility_01_austen_64kb-0870.wav", "sense_and_sensibility_01_austen_64kb-0920.wav")  # fmt: skip
PIECE_S = 5
OPEN_VOWELS, NARROW = ("aa", "ae", "ay", "aw"), ("s", "t", "iy", "ih", "n", "d")
ROUND, SPREAD = ("uw", "ow", "w", "ao"), ("iy", "ey")
Curves = NDArray[np.float64]


def kept_track(path: Path, folder: Path | None) -> Track:
    """Return the track of a video, without pictures.

    folder : where tracks are kept, by the content of the video; it is made if need be. None: tracked anew
    """
    if folder is None:
        return track(path, crops=False)
    kept = folder / f"{path.stem}-{sha256(path.read_bytes()).hexdigest()[:12]}.npz"
    if not kept.exists():
        found = track(path, crops=False)
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(
            kept, values=found.motion.values, rate_hz=found.motion.rate_hz, names=found.motion.names, seen=found.seen
        )
    with np.load(kept) as arrays:
        channels = tuple(Channel(str(name)) for name in arrays["names"])
        return Track(Motion(arrays["values"], float(arrays["rate_hz"]), channels), arrays["seen"])


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"), help="prepared, of the training speaker")
    parser.add_argument("--split", default="val")
    parser.add_argument("--open", type=Path, help="folder of videos of people who speak English")
    parser.add_argument("--whole", action="store_true", help="open recordings as they are, not in pieces")
    parser.add_argument("--tracks", type=Path, help="where tracks of videos are kept; default: they are not")
    parser.add_argument("--model", type=Path, help="default: the one that ships")
    parser.add_argument("--recogniser", default="auto")
    parser.add_argument("--live", type=float, metavar="MS", help="look-ahead of a stream")
    parser.add_argument("--pauses", choices=("natural", "rest"), default="natural")
    parser.add_argument("--only", action="append", choices=list(PARTS), help="repeatable; default: all")
    options = parser.parse_args()
    model = load_model(options.model)
    for name in options.only or PARTS:
        PARTS[name](options, model)


def move(sound: Audio | Path, options: argparse.Namespace, model: Model, words: str | None = None) -> Motion:
    """Return the motion of a recording, by ``animate`` or a stream."""
    if options.live is None:
        request = Request(sound, transcript=words, recogniser=options.recogniser, pauses=options.pauses)
        return animate(request, model=model).motion
    audio = read_audio(sound) if isinstance(sound, Path) else sound
    stream = Stream(audio.rate_hz, options.live, model, pauses=options.pauses, seed=None)
    frames = stream.push(audio.samples) + stream.flush()
    values = np.array([[frame[name] for name in CHANNELS] for frame in frames])
    return Motion(values, 1 / STEP_S, tuple(Channel(name) for name in CHANNELS))


def show(figure: str, **values: object) -> None:
    """Print one figure."""
    print(json.dumps({"figure": figure, **values}, ensure_ascii=False), flush=True)


def conditions(corpora: Path) -> dict[str, Callable[[Audio, int], Audio]]:
    """Return functions of a recording and a seed that put it into a condition."""
    voices = [read_audio(corpora / "speech-open" / name) for name in BABBLE]

    def in_room(audio: Audio, seed: int) -> Audio:
        count = RATE_HZ // 2  # RT60 of 0.5 s, reverberation as strong as the direct sound
        response = np.random.default_rng(seed).standard_normal(count) * 10 ** (-3 * np.arange(count) / count)
        response[0] = np.sqrt(np.square(response[1:]).sum())
        return Audio(fftconvolve(audio.samples, response)[: len(audio.samples)].astype(np.float32), RATE_HZ)

    def over_telephone(audio: Audio, _: int) -> Audio:
        band = butter(4, [300, 3400], "band", fs=RATE_HZ, output="sos")
        return Audio(sosfilt(band, audio.samples).astype(np.float32), RATE_HZ)

    return {
        "quiet": lambda audio, _: audio,
        "babble 20 dB": lambda audio, seed: mix_noise(audio, "babble", 20, voices, seed),
        "babble 10 dB": lambda audio, seed: mix_noise(audio, "babble", 10, voices, seed),
        "white 20 dB": lambda audio, seed: mix_noise(audio, "white", 20, seed=seed),
        "white 10 dB": lambda audio, seed: mix_noise(audio, "white", 10, seed=seed),
        "room": in_room,
        "telephone": over_telephone,
    }


def rooms(options: argparse.Namespace, model: Model) -> None:
    """Print the pooled correlations of the training speaker in each condition."""
    corpus = Corpus.open(options.corpus)
    utterances = [corpus.utterance(name) for name in corpus.names(options.split)]
    for name, condition in conditions(options.corpora).items():
        pairs = []
        for seed, utterance in enumerate(utterances):
            pairs.append(compared(move(condition(utterance.audio, seed), options, model), utterance.track))
        generated, tracked = (np.concatenate(each) for each in zip(*pairs, strict=True))
        show(f"{options.split}, {name}", clips=len(pairs), **correlations(generated, tracked))


def strangers(options: argparse.Namespace, model: Model) -> None:
    """Print the correlations of other GRID speakers."""
    clips = sorted((options.corpora / "grid-others").glob("*.mpg"))
    tracks = {clip: kept_track(clip, options.tracks) for clip in clips}
    for condition in ("audio only", "transcript") if options.live is None else ("audio only",):
        each = {}
        for clip in clips:
            words = " ".join(spell_name(clip.stem) or ()) if condition == "transcript" else None
            each[clip.stem] = best_lag(move(clip, options, model, words), tracks[clip], 0.06)
        show_means(f"grid-others, {condition}", each)


def phones(options: argparse.Namespace, model: Model) -> None:
    """Print how far and how wide the mouth opens in each phone, against the table of articulation."""
    values: dict[str, list[Curves]] = {}
    for name in SPOKEN:
        path = options.corpora / "speech-open" / name
        text = path.with_suffix(".txt")
        request = Request(path, transcript=(text if text.exists() else path.with_suffix(".lab")).read_text())
        result = animate(request, model=model)
        for span in result.units:
            middle = int((span.start_s + span.end_s) / 2 * result.motion.rate_hz)
            frame = [result.motion[channel][min(middle, len(result.motion.values) - 1)] for channel in CHANNELS]
            values.setdefault(span.label.phone, []).append(np.array(frame))
    means = {phone: np.mean(rows, axis=0) for phone, rows in values.items()}
    counts = {phone: len(rows) for phone, rows in values.items()}

    def mean_of(chosen: tuple[str, ...], channel: int) -> float:
        return float(np.mean(np.concatenate([[row[channel] for row in values[phone]] for phone in chosen])))

    table = read_articulation_table()
    common = [phone for phone in table if counts.get(phone, 0) >= 3 and phone not in ("sil", "sp")]
    ranks = {
        channel: round(float(spearmanr([table[p][1, n] for p in common], [means[p][n] for p in common])[0]), 3)
        for n, channel in enumerate(CHANNELS)
    }
    show(
        "speech-open with transcripts, by phone",
        opening_ratio=round(mean_of(OPEN_VOWELS, 0) / mean_of(NARROW, 0), 3),
        width_ratio=round(mean_of(ROUND, 1) / mean_of(SPREAD, 1), 3),
        rank_correlation=ranks,
        phones=len(common),
    )


def open_english(options: argparse.Namespace, model: Model) -> None:
    """Print the correlations of recordings in the open folder."""
    if options.open is None:
        return
    each = {}
    for path in sorted(options.open.rglob("*.mp4")):
        if "french" in path.stem:
            continue
        for name, audio, piece in pieces(path, options.tracks, whole=options.whole):
            each[name] = best_lag(move(audio, options, model), piece, 0.12)
    show_means("open English, audio only", each)


def pieces(path: Path, tracks: Path | None = None, *, whole: bool = False) -> Iterator[tuple[str, Audio, Track]]:
    """Yield pieces of five seconds of a video: name, sound, track; the whole track is kept in ``tracks``.

    whole : the video is one piece
    """
    audio, tracked = read_audio(path), kept_track(path, tracks)
    if whole:
        yield path.stem, audio, tracked
        return
    motion_of_all, rate = tracked.motion, tracked.motion.rate_hz
    for number in range(max(int(audio.duration_s / PIECE_S), 1)):
        end = len(motion_of_all.values) if audio.duration_s < 2 * PIECE_S else int((number + 1) * PIECE_S * rate)
        start = int(number * PIECE_S * rate)
        samples = audio.samples[int(start / rate * RATE_HZ) : int(end / rate * RATE_HZ)]
        motion = Motion(motion_of_all.values[start:end], rate, motion_of_all.channels)
        yield f"{path.stem} {number}", Audio(samples, RATE_HZ), Track(motion, tracked.seen[start:end])


def compared(motion: Motion, tracked: Track, lag_s: float = 0.0) -> tuple[Curves, Curves]:
    """Return generated and tracked channels in the frames with a face [each shape=(N, 3)]."""
    time_s = tracked.motion.time_s + lag_s
    generated = np.stack([np.interp(time_s, motion.time_s, motion[name]) for name in CHANNELS], axis=1)
    recorded = np.stack([tracked.motion[name] for name in CHANNELS], axis=1)
    return generated[tracked.seen], recorded[tracked.seen]


def correlations(generated: Curves, tracked: Curves) -> dict[str, float]:
    """Return the correlation of each channel."""
    return {name: round(float(np.corrcoef(generated[:, n], tracked[:, n])[0, 1]), 3) for n, name in enumerate(CHANNELS)}


def lag_of(motion: Motion, tracked: Track, limit_s: float) -> float:
    """Return the seconds by which the tracked opening leads the generated one, within a limit, where both fit best."""
    lags = np.arange(-limit_s, limit_s + 1e-9, 0.01).tolist()
    return max(lags, key=lambda lag: correlations(*compared(motion, tracked, lag))["opening"])


def best_lag(motion: Motion, tracked: Track, limit_s: float) -> dict[str, float]:
    """Return the correlations at the lag within a limit that is best for the opening."""
    return correlations(*compared(motion, tracked, lag_of(motion, tracked, limit_s)))


def show_means(figure: str, each: dict[str, dict[str, float]]) -> None:
    """Print the mean over clips of each channel, and the opening of every clip."""
    means = {name: round(float(np.mean([clip[name] for clip in each.values()])), 3) for name in CHANNELS}
    show(figure, clips=len(each), **means, each={name: clip["opening"] for name, clip in each.items()})


PARTS = {"rooms": rooms, "strangers": strangers, "phones": phones, "open": open_english}

if __name__ == "__main__":
    main()
