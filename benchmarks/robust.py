"""Speakers, words and lengths outside the training data of the shipped model: accuracy, speed, memory.

    python benchmarks/robust.py [--corpora FOLDER] [--model FILE]
        [--only others|conditions|phones|noise|silence|foreign|whole|hour|calls]

others : GRID clips of other speakers, correlation of opening per clip, audio only and with the words of the file's name
conditions: the same, audio only, and five clips of s1's validation list, in noise, in a room (0.6 s of reverberation,
         3 dB under the voice), over a telephone (300 to 3,400 Hz, 8 bits)
phones : recordings with transcripts of ``speech-open``, phone accuracy against their forced alignment by the general
         models, real-time factors (recognition in one process, warm, median of five), and the share of the speech of
         which words decided
noise  : sounds that are not speech: share of the time that is recognised as speech, and mean opening of the mouth
silence: a line beside zeros, noise and another voice, against the line alone: phones, difference of the opening
foreign: speech that is not English: share of the speech of which words decided, and their confidence
whole  : time of ``lipmotion animate`` on a minute of speech, whole processes, the second of two
hour   : peak memory and time of ``lipmotion animate`` on an hour of speech, a process of its own
calls  : memory of one process over a thousand ``animate`` calls
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import wave
from pathlib import Path

import numpy as np

from lipmotion import animate, load_model
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.speech.recognition.recogniser import RECOGNISER_KINDS, open_recogniser
from lipmotion.speech.sound.acoustic_conditions import mix_noise
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio
from lipmotion.units import Lexicon, is_silent, split_words
from lipmotion.units.phones import count_phone_edits
from lipmotion_faces.corpus.folder import spell_name
from lipmotion_faces.tracking.track import track

RATE_HZ = 16_000
SAME = {"ao": "aa", "zh": "sh"}
"""Phones that count as equal, beside reduced and full forms: two pairs that accents merge."""
SPOKEN = ("61-70968-0000.flac", "acoustic_corpus.wav", "cold_corpus.wav", "common_voice_en_22058264.mp3",
          "common_voice_en_22058266.mp3", "common_voice_en_22058267.mp3",
          *(f"sense_and_sensibility_01_austen_64kb-0{n}.wav" for n in (870, 880, 890, 920, 930)))  # fmt: skip


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--model", type=Path, help="default: the one that ships")
    parser.add_argument("--only", action="append", choices=list(PARTS), help="repeatable; default: all")
    options = parser.parse_args()
    model = load_model(options.model)
    for name in options.only or PARTS:
        PARTS[name](options.corpora, model, options.model)


def show(figure: str, **values: object) -> None:
    """Print one figure."""
    print(json.dumps({"figure": figure, **values}, ensure_ascii=False), flush=True)


def others(corpora: Path, model: Model, _: Path | None) -> None:
    """Print the correlation with the tracked openings of five GRID speakers."""
    clips = sorted((corpora / "grid-others").glob("*.mpg"))
    tracks = {clip: track(clip, crops=False) for clip in clips}
    for kind in RECOGNISER_KINDS:
        found: dict[str, list[float]] = {"audio only": [], "with transcript": []}
        for clip in clips:
            for condition, words in (("audio only", None), ("with transcript", " ".join(spell_name(clip.stem) or ()))):
                motion = animate(Request(clip, transcript=words, recogniser=kind), model=model).motion
                seen, recorded = tracks[clip].seen, tracks[clip].motion
                generated = np.interp(recorded.time_s, motion.time_s, motion["opening"])
                found[condition].append(float(np.corrcoef(generated[seen], recorded["opening"][seen])[0, 1]))
        for condition, values in found.items():
            each = {clip.stem: round(value, 3) for clip, value in zip(clips, values, strict=True)}
            show(f"grid-others, {kind}, {condition}: ACC opening", mean=round(float(np.mean(values)), 3), **each)


def conditions(corpora: Path, model: Model, _: Path | None) -> None:
    """Print the correlation with the tracked openings in noise, in a room and over a telephone."""
    voices = [read_audio(corpora / "speech-open" / name) for name in SPOKEN]
    own = [corpora / "grid-s1/clips" / f"{n}.mkv" for n in (corpora / "grid-s1/val.txt").read_text().split()[::5]]
    for name, clips in {"s1, val": own, "grid-others": sorted((corpora / "grid-others").glob("*.mpg"))}.items():
        found: dict[str, list[float]] = {}
        for number, clip in enumerate(clips):
            tracked, clean = track(clip, crops=False), read_audio(clip)
            time_s, samples = np.arange(len(clean.samples)) / RATE_HZ, clean.samples
            decay = np.random.default_rng(number).normal(size=9600) * np.exp(-6.9 * time_s[:9600] / 0.6)
            echo = np.convolve(samples, decay)[: len(samples)]
            hertz = np.fft.rfftfreq(len(samples), 1 / RATE_HZ)
            narrow = np.fft.irfft(np.fft.rfft(samples) * ((hertz > 300) & (hertz < 3400)), len(samples))
            sounds = {"clean": samples, "room": samples + echo * np.sqrt(0.5) * samples.std() / echo.std()}
            sounds |= {"telephone": np.round(narrow * 127) / 127}
            for kind, db in (("white", 20), ("white", 10), ("babble", 20), ("babble", 10)):
                sounds[f"{kind}, {db} dB"] = mix_noise(clean, kind, db, voices, number).samples
            for condition, sound in sounds.items():
                motion = animate(Request(Audio(sound.astype(np.float32), RATE_HZ)), model=model).motion
                pair = np.interp(tracked.motion.time_s, motion.time_s, motion["opening"]), tracked.motion["opening"]
                found.setdefault(condition, []).append(np.corrcoef(*(each[tracked.seen] for each in pair))[0, 1])
        show(f"{name}: ACC opening", **{condition: round(float(np.mean(each)), 3) for condition, each in found.items()})


def phones(corpora: Path, model: Model, _: Path | None) -> None:
    """Print the phone accuracy of the recordings with transcripts."""
    folder = corpora / "speech-open"
    recordings = []
    for name in SPOKEN:
        text = (folder / name).with_suffix(".txt")
        words = split_words((text if text.exists() else text.with_suffix(".lab")).read_text())
        audio = read_audio(folder / name)
        aligned = open_recogniser(model.phones, "general").align(audio, words, Lexicon())
        recordings.append((audio, spoken(span.label.phone for span in aligned)))
    for kind in RECOGNISER_KINDS:
        phone_recogniser = open_recogniser(model.phones, kind)
        found = [phone_recogniser.recognise(audio) for audio, _ in recordings]
        errors = [
            count_phone_edits(wanted, spoken(s.label.phone for s in each.units))
            for each, (_, wanted) in zip(found, recordings, strict=True)
        ]
        count = sum(len(wanted) for _, wanted in recordings)
        total_s = sum(audio.duration_s for audio, _ in recordings)
        times = [
            seconds(lambda: [phone_recogniser.recognise(a) for a, _ in recordings])  # noqa: B023
            for _ in range(5)
        ]
        show(
            f"speech-open, {kind}: phone accuracy",
            value=round(1 - sum(errors) / count, 3),
            phones=count,
            recordings=len(recordings),
            real_time_factor=round(statistics.median(times) / total_s, 4),
            by_words=round(sum(each.word_s for each in found) / sum(each.word_s + each.phone_s for each in found), 2),
        )


def spoken(names: object) -> list[str]:
    """Return phones without silence; phones that count as equal get one name."""
    return [SAME.get(name, name) for name in names if not is_silent(name)]  # type: ignore[attr-defined]


def seconds(work: object) -> float:
    """Return how long a call takes."""
    start = time.perf_counter()
    work()  # type: ignore[operator]
    return time.perf_counter() - start


def noise(corpora: Path, model: Model, _: Path | None) -> None:
    """Print the figures of sounds that are not speech."""
    recordings = {name: Audio(np.asarray(x, np.float32), RATE_HZ) for name, x in not_speech().items()}
    for name in ("breaths", "laughter", "whisper", "falsetto", "exaggerated", "longstop"):
        path = corpora / "speech-open" / f"mfa_{name}.flac"
        if path.exists():
            recordings[path.name] = read_audio(path)
    for name, audio in recordings.items():
        result = animate(audio, model=model)
        speech_s = sum(span.duration_s for span in result.units if not is_silent(span.label.phone))
        opening = result.motion["opening"]
        share = round(speech_s / audio.duration_s, 2)
        show(f"not speech: {name}", spoken=share, mean_opening=round(float(opening.mean()), 3))


def not_speech() -> dict[str, np.ndarray]:
    """Return five seconds of each kind of noise and music."""
    draw = np.random.default_rng(0)
    time_s = np.arange(5 * RATE_HZ) / RATE_HZ
    white = draw.normal(size=len(time_s))
    notes_hz = np.repeat([196, 220, 262, 294, 330, 262, 220, 196, 165, 196], len(time_s) // 10)
    phase = 2 * np.pi * np.cumsum(notes_hz) / RATE_HZ
    decay = np.tile(np.exp(-np.arange(len(time_s) // 10) / 6000), 10)
    hit = np.exp(-np.arange(4000) / 600)
    return {
        "digital silence": np.zeros(len(time_s)),
        "room noise (white, -60 dB)": 0.001 * white,
        "white noise (-20 dB)": 0.1 * white,
        "hum of 50 Hz": 0.1 * np.sin(2 * np.pi * 50 * time_s) + 0.001 * white,
        "siren": 0.3 * np.sin(2 * np.pi * np.cumsum(600 + 300 * np.sin(np.pi * time_s)) / RATE_HZ),
        "chord of sines": sum(0.1 * np.sin(2 * np.pi * f * time_s) for f in (261, 329, 392)),
        "plucked melody": decay * sum(0.2 / k * np.sin(k * phase) for k in range(1, 12)),
        "drums": 0.3 * np.tile(hit, 20) * draw.normal(size=len(time_s)),
        "clicks": 0.8 * (draw.random(len(time_s)) < 0.0005),
        "bursts of noise": 0.1 * white * np.maximum(0, np.sin(2 * np.pi * 0.4 * time_s)) ** 2,
    }


def silence(corpora: Path, model: Model, _: Path | None) -> None:
    """Print by how much what stands around a line changes its phones and its opening."""
    names = ("arctic_a0009.wav", "61-70968-0000.flac", "sense_and_sensibility_01_austen_64kb-0880.wav")
    files = [corpora / "speech-open" / name for name in (*names, "13697_11991_000000.opus")]
    lines = [read_audio(path).samples for path in [*files, corpora / "grid-others" / "lbax4n.mpg"]]
    lines = [samples[: len(samples) // 160 * 160] for samples in lines]
    rng = np.random.default_rng(0)

    def quiet(duration_s: float, units: int = 0) -> np.ndarray:
        return rng.uniform(-units, units, int(duration_s * RATE_HZ)) / 32_768

    for number, line in enumerate(lines):
        alone = animate(Audio(line, RATE_HZ), model=model)
        other = lines[0 if number == 1 else 1]
        around = {f"{units} units, {s} s": (quiet(s, units), line, quiet(s, units))
                  for s, units in ((0.5, 0), (5, 0), (20, 0), (5, 1), (5, 5), (5, 25))}  # fmt: skip
        around |= {f"gain {db} dB": (quiet(0), line * 10 ** (db / 20), quiet(0)) for db in (-20, -40)}
        around |= {f"after another voice, {s} s": (np.concatenate([other * 10 ** (-max(db, 0) / 20), quiet(s)]),
                                                   line * 10 ** (min(db, 0) / 20), quiet(0))
                   for s, db in ((0.5, 0), (1, -30), (5, 30))}  # fmt: skip
        for name, parts in around.items():
            start = len(parts[0]) // 160
            result = animate(Audio(np.concatenate(parts).astype(np.float32), RATE_HZ), model=model)
            own = result.units.between(start / 100, (start + len(line) // 160) / 100)
            said = [[span.label.phone for span in units if not is_silent(span.label.phone)]
                    for units in (alone.units, own)]  # fmt: skip
            difference = np.abs(
                result.motion["opening"][start : start + len(alone.motion.values)] - alone.motion["opening"]
            )
            show(f"line {number}, {name}", same_phones=said[0] == said[1], largest=round(float(difference.max()), 4),
                 mean=round(float(difference.mean()), 4))  # fmt: skip


def foreign(corpora: Path, model: Model, _: Path | None) -> None:
    """Print how far words decide of speech that is not English."""
    recogniser = open_recogniser(model.phones, "auto")
    for name in (
        "speech-open/common_voice_ja_24511055.mp3",
        "speech-open/13697_11991_000000.opus",
        "facegood/1114_2_01.wav",
    ):
        audio = read_audio(corpora / name)
        audio = Audio(audio.samples[: 40 * RATE_HZ], RATE_HZ)
        found = recogniser.recognise(audio)
        share = found.word_s / max(found.word_s + found.phone_s, 1e-9)
        show(f"foreign: {name}", by_words=round(share, 2), confidence=round(found.confidence or 0.0, 2))


def whole(corpora: Path, _: Model, model_file: Path | None) -> None:
    """Print the time of whole processes for a minute of speech."""
    samples = read_audio(corpora / "speech-open" / "threelittlekittens_01_rountreesmith.ogg").samples[: 60 * RATE_HZ]
    chosen = ["--model", str(model_file)] if model_file else []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "minute.wav"
        write_wave(path, samples)
        line = [sys.executable, "-m", "lipmotion.cli.main", "animate", str(path), "-o", f"{path}.csv", *chosen]
        for kind in ("auto", "fast"):
            command = [*line, "--recogniser", kind]
            times = [seconds(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL)) for _ in range(2)]  # noqa: B023
            show(f"a minute to .csv, {kind}", seconds=round(times[1], 2))


def write_wave(path: Path, samples: np.ndarray) -> None:
    """Write samples as a sound file of 16 bits."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes((np.clip(samples, -1, 1) * 32767).astype("<i2").tobytes())


def hour(corpora: Path, _: Model, model_file: Path | None) -> None:
    """Print peak memory and time for an hour: a repeated reading."""
    reading = read_audio(corpora / "speech-open" / "threelittlekittens_01_rountreesmith.ogg").samples
    samples = np.tile(reading, 1 + 3600 * RATE_HZ // len(reading))[: 3600 * RATE_HZ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hour.wav"
        write_wave(path, samples)
        del samples, reading
        chosen = ["--model", str(model_file)] if model_file else []
        for suffix in (".npz", ".json"):
            command = [
                sys.executable,
                "-m",
                "lipmotion.cli.main",
                "animate",
                str(path),
                "-o",
                f"{path}{suffix}",
                *chosen,
            ]
            time_s = seconds(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL))  # noqa: B023
            peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
            show(f"an hour to {suffix}: peak so far", megabytes=round(peak), seconds=round(time_s, 1))


def calls(corpora: Path, model: Model, _: Path | None) -> None:
    """Print the memory of the process over a thousand calls of ``animate``."""
    clip = read_audio(corpora / "grid-others" / "swwp2s.mpg")
    sizes = {}
    for number in range(1, 1001):
        animate(clip, model=model)
        if number in (50, 500, 1000):
            sizes[f"after {number}"] = round(resident_megabytes(), 1)
    show("animate, one process: resident megabytes", **sizes)


def resident_megabytes() -> float:
    """Return the memory that this process holds now (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


PARTS = {
    "others": others,
    "conditions": conditions,
    "phones": phones,
    "noise": noise,
    "silence": silence,
    "foreign": foreign,
    "whole": whole,
    "hour": hour,
    "calls": calls,
}

if __name__ == "__main__":
    main()
