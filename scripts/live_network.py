"""Makes two networks that ``animate`` teaches: of live speech, ``models/live.npz``, and ``models/general-motion.npz``.

    python scripts/live_network.py CORPUS TEXT VOICES...

CORPUS is a prepared corpus (GRID speaker s1), whose motion is measured; TEXT a folder of English pages, which flite,
festival and espeak-ng speak; VOICES folders of recordings, for which, as for these, ``animate`` with the shipped model
is the teacher. Every recording is heard as it is, by other vocal tracts, and in the conditions of training.

For ``live.npz``: ``speech-open``; LibriSpeech, one sentence of each of 251 readers and ten of each of ten others, as
Resemblyzer has them in ``audio_data``; speechocean762, the four longest sentences of each adult and the three longest
of each child older than eight, with their words; the commands of Picovoice's ``speech-to-intent-benchmark``; VCTK, as
AutoVC has it in ``wavs``; every third sentence of LJ Speech in PhilippMatthes/dc_tts. OLD, which half of s1,
``speech-open``, LibriSpeech and synthetic speech had taught in 4,000 steps, knew s1 and few voices; what it learned in

    --start OLD --mean OLD
    --start FIRST --steps 1500 --rate 1e-3 --measured 3 --mean OLD --share 0.25

with more of them keeps s1 (``val``: 0.802 at 80 ms, before 0.799). Errors are measured on recordings of which OLD had
heard some. ``general-motion.npz`` is of the same recordings as OLD.
"""

from __future__ import annotations

import argparse
import pickle
import re
import subprocess
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion import Corpus, Request, animate, load_model
from lipmotion.live.network import (
    LAGS,
    OUTPUTS,
    RANGE,
    SHAPE,
    SPEECH_RANGE,
    STEP_FRAMES,
    STEP_S,
    BandMeans,
    SoundFeatures,
    silent_step,
)
from lipmotion.meshes.fitting.shape_weights import viseme_curves
from lipmotion.meshes.model.shape_names import VISEMES_15
from lipmotion.motion.articulation import ARTICULATORS, measure_articulators
from lipmotion.motion.network_steps import ENCODING_SCALE, GENERAL_SHAPE, cut_random_piece
from lipmotion.motion.space import resample_track
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.speech.features.encoding import COMPONENTS
from lipmotion.speech.features.mfcc import WINDOW
from lipmotion.speech.sound.acoustic_conditions import apply_condition, mark_spoken
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.stats.network_training import TrainingPlan, TrainingSequence, fit_network
from lipmotion.stats.networks import ConvolutionalNetwork
from lipmotion.types import SPECTRUM_BANDS, Audio, Motion, Timeline, Track, Unit

OUTPUT = Path(__file__).parents[1] / "src" / "lipmotion" / "models" / "live.npz"
VOICES = [
    *(["flite", "-voice", name, "-o", "{file}", "-t", "{text}"] for name in ("kal", "awb", "rms", "slt", "kal16")),
    *(
        ["espeak-ng", "-v", name, "-w", "{file}", "{text}"]
        for name in ("en-us", "en-gb", "en-us+f2", "en-gb+m3", "en-us+f4", "en-gb-scotland+m7", "en-us+f5", "en-us+m1")
    ),
    *(
        ["text2wave", "-eval", f"(voice_{name})", "-o", "{file}", "{page}"]
        for name in ("kal_diphone", "cmu_us_slt_arctic_hts")
    ),
]
SOUNDS = (".flac", ".wav", ".opus", ".mp3", ".ogg")
HINTS, HINT_LAG, HINT_SHARE = COMPONENTS, 6, 0.25
"""In training it also says what the speech encoder makes of the sound, so many steps ago, with this share of the error:
who learns what the encoder knows learns the motion of unseen voices from fewer of them."""
SILENCE_S, MARGIN_S, MIN_S, LONGEST_S = 0.8, 0.3, 1.2, 20.0
"""Silence after every recording, in which the mouth comes to rest; how much is left of its own; and the shortest and
the longest piece of a recording."""
GAIN_DB, LARGEST_WARP, VERSIONS = (-14.0, 6.0), 0.16, 8
"""What is heard: as loud as is drawn, as it is, by other vocal tracts, and half of the time in a condition."""
VISEME_SCALE = 3.0  # what is said is learned with deviations about as large as those of the motion
MICROPHONE_DB, MICROPHONE_KNOTS = 4.0, 6
LARGEST_GAIN, CURVE_CLIPS, BABBLE = 1.6, 40, 40
PIECE_STEPS, HELD_OUT = 250, 20
REACH = sum(SHAPE.initial(1, 0).dilations)  # steps that the network hears before and after one
"""Steps of a piece for training; and one in so many recordings measures the errors instead."""
WEIGHTS_OF = dict.fromkeys(ARTICULATORS, 1.0) | {"opening": 4.0, "width": 3.0, "outer": 2.0}
Array = NDArray[np.float32]
Job = tuple[Audio, Track | None, str | None]  # a recording, its track, its words
GENERAL_STEPS, GENERAL_EVERY = 3500, 2
"""Of the optimiser for the general network, and steps of lessons from one of its own steps to the next."""


class Lesson(NamedTuple):
    """What is learned from a recording, in steps of 20 ms.

    targets   : articulators, visemes and the encoding in quiet [shape=(N, 23 + 64)]
    versions  : what is heard in several versions [each shape=(N, 82)]
    encodings : of those versions that are in a condition [each shape=(N, 64)]
    measured  : the motion is measured
    """

    targets: Array
    versions: list[Array]
    encodings: list[Array]
    measured: bool


def main() -> None:
    """Make the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("text", type=Path)
    parser.add_argument("voices", type=Path, nargs="+")
    parser.add_argument("--split", default="train")
    parser.add_argument("--minutes", type=float, default=8.0, help="of synthetic speech")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--steps", type=int, default=5000, help="of the optimiser")
    parser.add_argument("--rate", type=float, default=2e-3, help="of learning")
    parser.add_argument("--measured", type=int, default=1, help="times that measured motion is drawn more often")
    parser.add_argument("--start", type=Path, help="weights of a live network to begin with; default: random ones")
    parser.add_argument("--mean", type=Path, help="weights of a live network with which those learned are averaged")
    parser.add_argument("--share", type=float, default=0.5, help="of these in the mean")
    parser.add_argument("--keep", type=Path, help="a file that keeps what was prepared")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--general", type=Path, help="where the general network goes; default: it is not learned")
    options = parser.parse_args()
    if options.keep is not None and options.keep.exists():
        lessons = pickle.loads(options.keep.read_bytes())  # noqa: S301 - what a run before wrote
    else:
        lessons = list(prepare(options))
        if options.keep is not None:
            options.keep.write_bytes(pickle.dumps(lessons))
    print(f"{len(lessons)} recordings, {sum(len(targets) for targets, *_ in lessons) * STEP_S / 60:.1f} minutes")
    typical = measure_bands(lessons)
    if options.general is not None:
        np.savez_compressed(options.general, **learn_general(lessons))
    network = learn(lessons, typical, options)
    if options.mean is not None:
        pairs = zip(network.parameters, read_network(options.mean).parameters, strict=True)
        network = network.with_parameters([own + options.share * (other - own) for own, other in pairs])
    arrays = {name: array.astype(np.float16) for name, array in SHAPE.arrays(network).items()}
    rounded = SHAPE.from_arrays(arrays, len(LAGS) * OUTPUTS)
    count, predicted, wanted = len(ARTICULATORS), [], []
    for number, (targets, versions, *_) in enumerate(lessons[::HELD_OUT]):
        sequence = shift(hear(versions[number % VERSIONS], typical, ()), targets, typical)
        known = sequence.targets[:, :-HINTS] / output_scale()
        for rows, kept in ((rounded(sequence.inputs), predicted), (known, wanted)):
            kept.append(rows[: len(targets)].reshape(-1, len(LAGS), OUTPUTS)[:, :, :count])
    people = np.concatenate([np.diff(targets[:, :count], 2, axis=0) for targets, *_ in lessons])
    guesses, truth = np.concatenate(predicted), np.concatenate(wanted)
    arrays["variances"] = np.square(guesses - truth).mean(axis=0)
    arrays["acceleration"] = np.square(people).mean(axis=0)
    arrays["gains"] = np.clip(truth.std(axis=0) / guesses.std(axis=0), 1, LARGEST_GAIN)
    arrays["typical"] = typical.astype(float)
    arrays["curves"] = fit_curves(load_model(), Corpus.open(options.corpus))
    correlations = [
        [float(np.corrcoef(guesses[:, lag, n], truth[:, lag, n])[0, 1]) for n in range(count)]
        for lag in range(len(LAGS))
    ]
    print("correlation of articulators by lag:", np.round(correlations, 3).tolist())
    with options.output.open("wb") as file:
        np.savez_compressed(file, **arrays)
    print(f"{options.output.name}: {options.output.stat().st_size} bytes")


def learn(lessons: list[Lesson], typical: Array, options: argparse.Namespace) -> ConvolutionalNetwork:
    """Return a network that is trained with all lessons but those that measure its errors, without its hints.

    A recording is drawn as often as it has pieces, so that who speaks longer is heard more.
    """
    sequences, pieces = [], []
    for number, (targets, versions, _, measured) in enumerate(lessons):
        if number % HELD_OUT:
            pieces += [len(sequences)] * -(-len(targets) // PIECE_STEPS) * (options.measured if measured else 1)
            heard = (hear(levels, typical, (number, version)) for version, levels in enumerate(versions))
            sequences.append([shift(each, targets, typical) for each in heard])
    weights = np.tile([*(WEIGHTS_OF[name] for name in ARTICULATORS), *np.ones(len(VISEMES_15))], len(LAGS))
    weights = np.append(weights, np.full(HINTS, HINT_SHARE * weights.sum() / HINTS))

    def draw(rng: np.random.Generator, number: int) -> TrainingSequence:
        versions = sequences[pieces[number]]
        whole = versions[int(rng.integers(len(versions)))]
        return cut(whole, int(rng.integers(max(len(whole.inputs) - PIECE_STEPS, 0) + 1)))

    plan = TrainingPlan(options.steps, batch_size=16, rate=options.rate, dropout=0.15, seed=0)
    network = SHAPE.initial(len(LAGS) * OUTPUTS + HINTS, 0)
    if options.start is not None:
        network = take_weights(network, read_network(options.start))
    network = fit_network(network, draw, len(pieces), weights, plan, report)
    return network.with_parameters(
        [*network.parameters[:-2], *(array[..., :-HINTS] / output_scale() for array in network.parameters[-2:])]
    )


def read_network(path: Path) -> ConvolutionalNetwork:
    """Return the network of a file that this script made."""
    with np.load(path) as stored:
        return SHAPE.from_arrays({name: stored[name] for name in SHAPE.specs}, len(LAGS) * OUTPUTS)


def take_weights(network: ConvolutionalNetwork, known: ConvolutionalNetwork) -> ConvolutionalNetwork:
    """Return a network with the weights of a known one, but its own for the hints."""
    last = [
        np.concatenate([array * output_scale(), own[..., -HINTS:]], axis=-1)
        for array, own in zip(known.parameters[-2:], network.parameters[-2:], strict=True)
    ]
    return network.with_parameters([*known.parameters[:-2], *last])


def learn_general(lessons: list[Lesson]) -> dict[str, NDArray[np.float16]]:
    """Return the arrays of the general network, from the encoding in quiet and in conditions to articulators."""
    shape, every = GENERAL_SHAPE, GENERAL_EVERY
    sequences = [
        [
            TrainingSequence(
                encoding[::every] * ENCODING_SCALE,
                targets[::every, : len(ARTICULATORS)],
                np.ones(-(-len(targets) // every), bool),
            )
            for encoding in (*[targets[:, OUTPUTS:]] * len(encodings or "1"), *encodings)
        ]
        for targets, _, encodings, _ in lessons
    ]

    def draw(rng: np.random.Generator, number: int) -> TrainingSequence:
        versions = sequences[number]
        return cut_random_piece(versions[int(rng.integers(len(versions)))], rng)

    weights = np.array([WEIGHTS_OF[name] for name in ARTICULATORS])
    plan = TrainingPlan(GENERAL_STEPS, batch_size=24, rate=2e-3, dropout=0.2, seed=0)
    network = fit_network(shape.initial(len(ARTICULATORS), 0), draw, len(sequences), weights, plan, report)
    return {name: array.astype(np.float16) for name, array in shape.arrays(network).items()}


def report(step: int, error: float) -> None:
    """Print how training goes on."""
    if step % 100 == 0:
        print(step, round(error, 4), flush=True)


def fit_curves(model: Model, corpus: Corpus) -> NDArray[np.float64]:
    """Return the ridge regression from 1, articulators and visemes to ARKit's weights of the mouth [shape=(24, 28)]."""
    inputs, outputs = [], []
    for name in corpus.names("train")[:CURVE_CLIPS]:
        result = animate(Request(corpus.utterance(name).audio), model=model)
        visemes = viseme_curves(result.units, result.motion.time_s)
        said = np.stack([visemes[viseme] for viseme in VISEMES_15], axis=1)
        articulators = standard_articulators(model, result.motion)
        inputs.append(np.concatenate([np.ones((len(said), 1)), articulators, said], axis=1))
        outputs.append(make_curves(result.motion, result.units, "arkit").values)
    x, y = np.concatenate(inputs), np.concatenate(outputs)
    return np.linalg.solve(x.T @ x + np.eye(x.shape[1]), x.T @ y)


def output_scale() -> Array:
    """Return what the outputs are multiplied by in training [shape=(5 · 23,)]."""
    return np.tile([*np.ones(len(ARTICULATORS)), *np.full(len(VISEMES_15), VISEME_SCALE)], len(LAGS)).astype(np.float32)


def measure_bands(lessons: list[Lesson]) -> Array:
    """Return the mean of every band in speech, relative to the level [shape=(40,)]."""
    rows = (
        np.concatenate([versions[0] for _, versions, *_ in lessons]).astype(np.float32).reshape(-1, SPECTRUM_BANDS + 1)
    )
    mean: Array = rows[rows[:, -1] > -SPEECH_RANGE, :-1].mean(axis=0)
    return mean


def hear(levels: Array, typical: Array, seed: tuple[int, ...]) -> Array:
    """Return the features of every step [shape=(N, 82)], through a microphone that is drawn; seed (): a flat one."""
    rows = levels.astype(np.float32).reshape(-1, SPECTRUM_BANDS + 1)
    if seed:
        rng = np.random.default_rng(seed)
        knots = rng.normal(0, MICROPHONE_DB / 10 * np.log(10), MICROPHONE_KNOTS)
        tone = np.interp(np.linspace(0, 1, SPECTRUM_BANDS), np.linspace(0, 1, MICROPHONE_KNOTS), knots)
        rows = np.maximum(rows + np.append(tone, 0).astype(np.float32), -RANGE)
    bands = BandMeans(typical)
    return np.stack([bands.push(row) for row in rows]).reshape(len(levels), -1)


def shift(inputs: Array, targets: Array, typical: Array) -> TrainingSequence:
    """Return inputs, after the silence that the network begins with, with the targets of all lags, each as late."""
    steps = len(inputs)
    heard = np.concatenate([np.tile(silent_step(typical), (REACH, 1)), inputs])
    wanted = np.clip(np.arange(len(heard))[:, None] - np.array(LAGS), 0, steps - 1)
    rows = targets[wanted, :OUTPUTS].reshape(len(heard), -1) * output_scale()
    hints = targets[np.clip(np.arange(len(heard)) - HINT_LAG, 0, steps - 1), OUTPUTS:]
    return TrainingSequence(heard, np.concatenate([rows, hints], axis=1), np.arange(len(heard)) < steps)


def cut(whole: TrainingSequence, start: int) -> TrainingSequence:
    """Return a piece, of which counts what the network hears all of."""
    piece = TrainingSequence(*(part[start : start + PIECE_STEPS + 2 * REACH] for part in whole))
    places = np.arange(len(piece.inputs))
    return piece._replace(valid=piece.valid & (places < len(places) - REACH) & ((start == 0) | (places >= REACH)))


def prepare(options: argparse.Namespace) -> Iterator[Lesson]:
    """Yield the lessons of all recordings."""
    corpus = Corpus.open(options.corpus)
    jobs: list[Job] = [job for folder in options.voices for job in read_voices(folder)]
    babble = [audio for audio, *_ in jobs[:BABBLE]]
    for name in corpus.names(options.split):
        utterance = corpus.utterance(name)
        jobs.append((utterance.audio, utterance.track, " ".join(utterance.words or ())))
    jobs += synthesise(options.text, options.minutes)
    with ProcessPoolExecutor(options.workers) as pool:
        lesson = partial(teach, babble=babble, encoded=options.general is not None)
        yield from pool.map(lesson, jobs, range(len(jobs)), chunksize=8)


def read_voices(folder: Path) -> Iterator[Job]:
    """Yield the recordings of a folder without the silence around them, with the words of a ``.txt`` beside them.

    Longer ones are cut into pieces, without words.
    """
    for path in sorted(folder.rglob("*")):
        if path.suffix not in SOUNDS or (audio := read_audio(path)).duration_s < MIN_S:
            continue
        rate_hz, spoken, text = audio.rate_hz, np.flatnonzero(mark_spoken(audio)), path.with_suffix(".txt")
        margin, longest = int(MARGIN_S * rate_hz), int(LONGEST_S * rate_hz)
        samples = audio.samples[max(spoken[0] - margin, 0) : spoken[-1] + margin]
        words = text.read_text("utf-8") if text.exists() and len(samples) <= longest else None
        for start in range(0, len(samples) - int(MIN_S * rate_hz), longest):
            yield Audio(samples[start : start + longest], rate_hz), None, words


def teach(job: Job, number: int, babble: list[Audio], *, encoded: bool) -> Lesson:
    """Return the lesson of a recording: of its measured motion, where there is a track, else of what ``animate`` makes.

    job : the recording, its track, its words
    """
    audio, tracked, words = job
    model = load_model()
    result = animate(Request(audio, transcript=words, pauses="natural"), model=model)
    motion = result.motion
    if tracked is not None:
        measured, _ = resample_track(tracked, len(motion.values))
        values = measured.values - measured.values.mean(axis=0) + motion.values.mean(axis=0)  # the pose is not heard
        motion = replace(measured, values=values)
    lesson = make_lesson(model, audio, motion, result.units, babble, number, encoded=encoded)
    return lesson._replace(measured=tracked is not None)


def synthesise(folder: Path, minutes: float) -> Iterator[Job]:
    """Yield sentences of pages, spoken by one voice after the other."""
    words = " ".join(path.read_text("utf-8") for path in sorted(folder.rglob("*.md")))
    sentences = list(re.findall(r"[A-Z][a-z]+ [a-z ,']{30,110}[a-z]\.", words.replace("\n", " ")))
    rng, spoken_s = np.random.default_rng(0), 0.0
    with tempfile.TemporaryDirectory() as kept:
        file, page = Path(kept) / "a.wav", Path(kept) / "a.txt"
        for number, place in enumerate(rng.permutation(len(sentences)).tolist()):
            page.write_text(sentences[place], "utf-8")
            known = {"file": str(file), "text": sentences[place], "page": str(page)}
            command = [part.format(**known) for part in VOICES[number % len(VOICES)]]
            subprocess.run(command, check=True, capture_output=True)
            audio = read_audio(file)
            spoken_s += audio.duration_s
            yield audio, None, sentences[place]
            if spoken_s > 60 * minutes:
                return
    raise SystemExit(f"{folder}: {len(sentences)} sentences are {spoken_s / 60:.1f} minutes, required {minutes:g}")


def make_lesson(
    model: Model, audio: Audio, motion: Motion, units: Timeline[Unit], babble: list[Audio], seed: int, *, encoded: bool
) -> Lesson:
    """Return the targets of a recording, silence after it, and what is heard in several versions."""
    silence = np.zeros(int(SILENCE_S * audio.rate_hz), np.float32)
    longer = Audio(np.concatenate([audio.samples, silence]), audio.rate_hz)
    steps = int(longer.duration_s / STEP_S)
    time_s = np.arange(steps) * STEP_S
    articulators = standard_articulators(model, motion)
    inside = np.stack([np.interp(time_s, motion.time_s, column) for column in articulators.T], axis=1)
    visemes = np.stack([viseme_curves(units, time_s)[name] for name in VISEMES_15], axis=1)
    visemes[time_s > audio.duration_s] = np.eye(len(VISEMES_15))[0]
    targets = np.concatenate([inside, visemes, encode(audio, steps)], axis=1).astype(np.float32)
    versions, encodings = [], []
    for number in range(VERSIONS):
        rng = np.random.default_rng([seed, number])
        heard = longer
        if number >= VERSIONS // 2:
            heard, _ = apply_condition(longer, babble, rng)
            encodings += [encode(heard, steps)] if encoded else []
        warp = float(np.exp(rng.uniform(-LARGEST_WARP, LARGEST_WARP))) if number else 1.0
        gain = np.float32(10 ** (rng.uniform(*GAIN_DB) / 20))
        samples = np.pad(heard.samples * gain, (0, WINDOW))
        rows = np.stack(SoundFeatures(np.zeros(SPECTRUM_BANDS, np.float32), warp).list_levels(samples))[
            : steps * STEP_FRAMES
        ]
        versions.append(rows.reshape(steps, -1).astype(np.float16))
    return Lesson(targets, versions, encodings, measured=False)


def encode(audio: Audio, steps: int) -> Array:
    """Return what the speech encoder makes of a recording [shape=(steps, 64)]; beyond its end there are zeros."""
    result = np.zeros((steps, HINTS), np.float32)
    known = analysed(audio).encoding[::STEP_FRAMES][:steps]
    result[: len(known)] = known
    return result


def standard_articulators(model: Model, motion: Motion) -> NDArray[np.float64]:
    """Return the articulators of motion in deviations from the pose of the table of a model [shape=(T, 8)]."""
    prior, space = model.learned.prior, model.learned.space
    poses = np.concatenate([prior.centre[None], prior.centre + prior.matrix])
    rows = space.restore(poses)
    names = [channel.name for channel in space.channels]
    known, measured = measure_articulators(rows, names), measure_articulators(motion.values, motion.names)
    base, *moved = np.stack([known[name] for name in ARTICULATORS], axis=1)
    centred = np.stack([measured[name] for name in ARTICULATORS], axis=1) - base
    return np.linalg.solve((np.array(moved) - base).T, centred.T).T


if __name__ == "__main__":
    main()
