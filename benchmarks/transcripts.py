"""Transcripts: how well long recordings are aligned with them, with and without times; whether wrong ones are doubted.

    python benchmarks/transcripts.py [--minutes 60] [--cases lines,none] [--grid FOLDER]
    python benchmarks/transcripts.py --doubt CORPORA
    python benchmarks/transcripts.py --hint CORPORA [--every 5]

Sentences in the voices of flite, whose words' times are known, follow one another with pauses of up to three seconds,
in noise 30 dB under the speech. The transcript is written as a file and read as a user's is; its times differ as the
case says. One JSON object per case, each in a process of its own: ``median_ms``, ``p90_ms``: distance of the start of a
word from the true one; ``lost``: share of the words that are more than half a second away; ``wall_s``,
``cpu_s``: of reading the transcript and aligning it, features included; ``peak_mb``: of the process, with the sound.

With ``--doubt`` short recordings get right and wrong transcripts: sentences in all installed voices, ``speech-open``,
GRID s1. One JSON object per set and kind of transcript: ``doubted``: as being of something else; ``left_out``: as
leaving out words; ``either``, or refused as too long. ``heard_…``: the same by the posteriors of a phone
recogniser, where one is installed; ``heard_words``: where words are named that are not said.

With ``--hint`` the phones in time that ``animate`` takes, of the same recordings with right and wrong transcripts and
none, are compared with those of the right transcript: ``phones``: phone accuracy; ``visemes``: share of the frames with
the same viseme; ``warned``: recordings with a warning. ``--every``: of so many recordings one.
"""

from __future__ import annotations

import argparse
import json
import logging
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from robust import SPOKEN

import lipmotion
from lipmotion.errors import AlignmentError
from lipmotion.formats.label_files import read_transcript
from lipmotion.pipeline.analysis.speech_analysis import analyse_speech
from lipmotion.pipeline.analysis.transcribe import transcribe
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.training.prompts import prompts
from lipmotion.speech.recognition.agreement import DOUBTFUL_SCORE, measure_fit
from lipmotion.speech.recognition.network.posteriors import (
    POSTERIOR_STEP,
    PhonePosteriors,
    find_installed_recogniser,
    load_phone_recogniser,
)
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.recognition.transcript_evidence import find_evidence
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.installed import list_installed, speak_sentences
from lipmotion.speech.voices.synthesiser import SyntheticVoice
from lipmotion.types import FRAME_RATE_HZ, Audio, TimedTranscript, Timeline, Unit
from lipmotion.units import VISEME_OF, Lexicon, is_silent, split_words
from lipmotion.units.phones import count_phone_edits
from lipmotion_faces.corpus.folder import spell_name

RATE_HZ, NOISE_DB, LONGEST_PAUSE_S, LOST_S = 16_000, -30, 3.0, 0.5
Row = tuple[str, float, float]  # a word, its start and its end in seconds
Said = tuple[NDArray[np.float32], tuple[str, ...]]  # samples, and the words that are said
Hearing = Callable[[NDArray[np.float32]], NDArray[np.float64]]
"""Samples to log posteriors of phones and blank [shape=(T, 48)]."""
HEARD_S, PIECE_S = POSTERIOR_STEP / FRAME_RATE_HZ, 25
"""From row to row of posteriors; what a network is given at once: hama hears nothing after 30 s."""


@dataclass(frozen=True)
class Change:
    """How the times of a transcript differ from the true ones, and its words from those that are said.

    form     : ``srt`` (a line a sentence), ``json`` (words in time) or ``txt``
    jitter_s : standard deviation of the error of every time
    late_s   : added to all times
    missing  : share of the lines that are left out
    longer_s : by how much lines stay longer than they are said
    """

    form: str
    jitter_s: float = 0.0
    late_s: float = 0.0
    missing: float = 0.0
    longer_s: float = 0.0


CASES = {
    "none": Change("txt"),
    "lines": Change("srt"),
    "lines 0.3 s": Change("srt", 0.3, longer_s=0.7),
    "lines 0.6 s": Change("srt", 0.6, longer_s=0.7),
    "lines 2 s late": Change("srt", 0.3, late_s=2.0),
    "lines 30 s late": Change("srt", 0.3, late_s=30.0),
    "lines lacking": Change("srt", 0.3, missing=0.1),
    "none lacking": Change("txt", missing=0.1),
    "words 0.2 s": Change("json", 0.2),
}


def main() -> None:
    """Print one JSON object per case."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--grid", type=Path, metavar="FOLDER", help="GRID speaker s1 in place of flite's voices")
    parser.add_argument("--doubt", type=Path, metavar="CORPORA", help="whether wrong transcripts are doubted")
    parser.add_argument("--hint", type=Path, metavar="CORPORA", help="what wrong transcripts make of the phones")
    parser.add_argument("--every", type=int, default=1, metavar="N")
    parser.add_argument("--one", nargs=3, metavar=("FOLDER", "CASE", "RECOGNISER"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        folder, case, recogniser = options.one
        print(json.dumps(_measured(Path(folder), case, recogniser)), flush=True)
        return
    if options.doubt:
        _print_doubts(options.doubt)
        return
    if options.hint:
        _print_hints(options.hint, options.every)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        spoken = _grid_sentences(options.grid) if options.grid else _synthetic_sentences()
        samples, sentences = _speech(spoken, 60 * options.minutes, shuffled=options.grid is None)
        np.save(folder / "speech.npy", samples)
        (folder / "said.json").write_text(json.dumps(sentences), encoding="utf-8")
        recogniser = "general" if options.grid else "auto"  # the shipped model was trained on s1
        for case in options.cases.split(","):
            subprocess.run([sys.executable, __file__, "--one", name, case.strip(), recogniser], check=True)


def _synthetic_sentences() -> list[tuple[NDArray[np.float32], list[Row]]]:
    """Return sentences in the voices of flite: samples, and words in time."""
    texts = [prompt.text for prompt in prompts(count=400).chosen]
    texts = [text for text in texts if len(split_words(text)) > 2]
    voices = [voice for voice in list_installed() if voice.synthesiser == "flite"]
    spoken = [item for voice in voices for item in zip(texts, speak_sentences(texts, voice), strict=True)]
    timed = [(text, audio.samples, _word_times(units)) for text, (audio, units, _) in spoken]
    return [
        (samples, rows)
        for text, samples, rows in timed
        if tuple(word for word, *_ in rows) == split_words(text)  # else one is read otherwise
    ]


def _grid_sentences(folder: Path) -> list[tuple[NDArray[np.float32], list[Row]]]:
    """Return the sentences of a GRID speaker's training list: samples, and words in time (unit 1/25000 s)."""
    sentences = []
    for name in (folder / "train.txt").read_text("utf-8").split():
        rows = [row.split() for row in (folder / "align" / f"{name}.align").read_text("utf-8").splitlines()]
        words = [
            (word, int(start) / 25_000, int(end) / 25_000) for start, end, word in rows if word not in ("sil", "sp")
        ]
        sentences.append((read_audio(folder / "clips" / f"{name}.mkv").samples, words))
    return sentences


def _speech(
    spoken: list[tuple[NDArray[np.float32], list[Row]]], duration_s: float, shuffled: bool
) -> tuple[NDArray[np.float32], list[list[Row]]]:
    """Return speech with pauses in noise, and its sentences; those of a shuffled list may come several times."""
    draw = np.random.default_rng(0)
    order = draw.integers(len(spoken), size=100_000) if shuffled else np.arange(len(spoken))
    pieces, sentences, at_s = [], [], 0.0
    for number in order:
        if at_s >= duration_s:
            break
        sound, rows = spoken[number]
        pause_s = float(draw.uniform(0.1, LONGEST_PAUSE_S))
        pause = np.zeros(int(pause_s * RATE_HZ), np.float32)
        at_s += len(pause) / RATE_HZ
        sentences.append([(word, start_s + at_s, end_s + at_s) for word, start_s, end_s in rows])
        pieces += [pause, sound]
        at_s += len(sound) / RATE_HZ
    samples = np.concatenate(pieces)
    level = 10 ** (NOISE_DB / 20) * float(np.sqrt(np.mean(samples**2)))
    return samples + draw.normal(0, level, len(samples)).astype(np.float32), sentences


def _word_times(units: Timeline[Unit]) -> list[Row]:
    """Return the words of a timeline with their times."""
    rows = []
    for word, spans in groupby(units, key=lambda span: span.label.word):
        inside = list(spans)
        if word:
            rows.append((word, inside[0].start_s, inside[-1].end_s))
    return rows


def _measured(folder: Path, name: str, recogniser: str) -> dict[str, object]:
    """Return the figures of one case."""
    logging.basicConfig(format="%(message)s")
    sentences = [[tuple(row) for row in rows] for rows in json.loads((folder / "said.json").read_text("utf-8"))]
    path, kept = _written(folder, sentences, CASES[name])
    audio = Audio(np.load(folder / "speech.npy"), RATE_HZ)
    phones = Recogniser(lipmotion.load_model().phones, recogniser)
    start, start_cpu = time.perf_counter(), time.process_time()
    transcript = read_transcript(path)
    words = transcript if isinstance(transcript, TimedTranscript) else split_words(transcript)
    analysed_audio = analysed(audio)
    units = transcribe(phones, analysed_audio, words, Lexicon()).units or Timeline(())
    wall_s, cpu_s = time.perf_counter() - start, time.process_time() - start_cpu
    peak_mb = _peak_mb()
    errors_s = _errors(_word_times(units), [row for rows in kept for row in rows])
    return {
        "case": name,
        "minutes": round(audio.duration_s / 60, 1),
        "words": sum(map(len, sentences)),
        "median_ms": round(1000 * float(np.median(errors_s)), 1),
        "p90_ms": round(1000 * float(np.quantile(errors_s, 0.9)), 1),
        "lost": round(float(np.mean(errors_s > LOST_S)), 4),
        "wall_s": round(wall_s, 1),
        "cpu_s": round(cpu_s, 1),
        "peak_mb": peak_mb,
    }


def _print_doubts(corpora: Path) -> None:
    """Print how many transcripts of each kind are doubted."""
    logging.getLogger("lipmotion").setLevel(logging.ERROR)
    phones, hear = Recogniser(lipmotion.load_model().phones), _network()
    for name, recordings in _sets(corpora).items():
        counts: dict[str, Counter[str]] = {}
        for kind, samples, words in _transcripts(recordings):
            audio = analysed(Audio(samples, RATE_HZ))
            found = _doubts(phones, audio, words, hear)
            counts.setdefault(kind, Counter()).update(found | {"count": 1})
        for kind, count in counts.items():
            print(json.dumps({"set": name, "transcript": kind, **count}), flush=True)


def _sets(corpora: Path) -> dict[str, list[Said]]:
    """Return sets of short recordings with their words."""
    sets = {f"GRID s1, {split}": _clips(corpora / "grid-s1", split) for split in ("val", "test")}
    sets |= {"speech-open": _open_recordings(corpora / "speech-open")}
    for makers in (("flite", "festival"), ("espeak-ng",)):
        sets[" and ".join(makers)] = _voiced([voice for voice in list_installed() if voice.synthesiser in makers])
    return sets


def _print_hints(corpora: Path, every: int) -> None:
    """Print how far the phones of wrong transcripts are from those of the right ones."""
    warnings = list[str]()
    handler = logging.Handler()
    handler.emit = lambda record: warnings.append(record.getMessage())  # type: ignore[method-assign]
    logging.getLogger("lipmotion").addHandler(handler)
    logging.getLogger("lipmotion").propagate = False
    model = lipmotion.load_model()
    for name, recordings in _sets(corpora).items():
        sums: dict[str, Counter[str]] = {}
        for number in range(0, len(recordings), every):
            audio, wanted = analysed(Audio(recordings[number][0], RATE_HZ)), Timeline[Unit](())
            for kind, words in _hints(recordings, number).items():
                warnings.clear()
                units = analyse_speech(model, Request(audio, transcript=" ".join(words) or None)).speech.units
                wanted = units if kind == "right" else wanted
                said, found = ([s.label.phone for s in u if not is_silent(s.label.phone)] for u in (wanted, units))
                sums.setdefault(kind, Counter()).update(
                    count=1,
                    warned=bool([text for text in warnings if "dictionary" not in text]),
                    phones=1 - count_phone_edits(said, found) / max(len(said), 1),  # type: ignore[arg-type]
                    visemes=float(np.mean(_visemes(wanted) == _visemes(units))),  # type: ignore[arg-type]
                )
        for kind, total in sums.items():
            means = {key: round(total[key] / total["count"], 3) for key in ("phones", "visemes")}
            print(json.dumps({"set": name, "transcript": kind, **total, **means}), flush=True)


def _hints(recordings: Sequence[Said], number: int) -> dict[str, tuple[str, ...]]:
    """Return right and wrong words of a recording, and none."""
    words = recordings[number][1]
    others = [other for _, other in recordings[number:] + recordings[:number] if other != words]
    other, half = others[3 % len(others)], (len(words) + 1) // 2
    draw = np.random.default_rng(number)
    replaced = list(words)
    for place in draw.choice(len(words), max(1, len(words) // 4), replace=False):
        replaced[place] = str(draw.choice([word for each in others for word in each if word != words[place]]))
    return {"right": words, "none": (), "first half": words[:half], "last half": words[half:] or words,
            "every other word": words[::2], "a sentence too many, last": words + other,
            "a sentence too many, first": other + words, "one word in four replaced": tuple(replaced),
            "another sentence": other}  # fmt: skip


def _visemes(units: Timeline[Unit]) -> NDArray[np.str_]:
    """Return the viseme of every frame."""
    edges = np.round([FRAME_RATE_HZ * span.end_s for span in units]).astype(int)
    return np.repeat([VISEME_OF[span.label.phone] for span in units], np.diff(edges, prepend=0))


def _doubts(phones: Recogniser, audio: AnalysedAudio, words: tuple[str, ...], hear: Hearing | None) -> dict[str, bool]:
    """Return which doubts of a transcript there are; one that is refused is doubted in every way."""
    try:
        units = phones.align(audio, words, Lexicon())
    except AlignmentError:
        return dict.fromkeys(("refused", "either", "heard_either"), True)
    fit = measure_fit(audio, units)
    found = {"doubted": fit.score < DOUBTFUL_SCORE, "left_out": bool(fit.missing)}
    found["either"] = any(found.values())
    if hear is not None:
        evidence = find_evidence(hear(audio.samples), HEARD_S, units)
        heard = {"doubted": evidence.is_doubtful, "left_out": evidence.gaps, "words": evidence.unsaid}
        found |= {f"heard_{key}": bool(value) for key, value in heard.items()}
        found["heard_either"] = any(heard.values())
    return found


def _clips(folder: Path, split: str) -> list[Said]:
    """Return the clips of a list of GRID s1, with their words."""
    names = (folder / f"{split}.txt").read_text("utf-8").split()
    return [(read_audio(folder / "clips" / f"{name}.mkv").samples, spell_name(name) or ()) for name in names]


def _open_recordings(folder: Path) -> list[Said]:
    """Return the English recordings of ``speech-open``, with their words."""
    texts = [(folder / name).with_suffix(".txt") for name in SPOKEN]
    texts = [text if text.exists() else text.with_suffix(".lab") for text in texts]
    words = [split_words(text.read_text("utf-8")) for text in texts]
    return [(read_audio(folder / name).samples, said) for name, said in zip(SPOKEN, words, strict=True)]


def _voiced(voices: Sequence[SyntheticVoice]) -> list[Said]:
    """Return eight sentences in each of some synthetic voices, with their words."""
    texts = [prompt.text for prompt in prompts(count=300).chosen if 5 <= len(split_words(prompt.text)) <= 12][::7][:8]
    return [
        (audio.samples, split_words(text))
        for voice in voices
        for text, (audio, _, _) in zip(texts, speak_sentences(texts, voice), strict=True)
    ]


def _transcripts(recordings: Sequence[Said]) -> Iterator[tuple[str, NDArray[np.float32], tuple[str, ...]]]:
    """Yield recordings with right and wrong words: the kind, the samples and the words."""
    draw = np.random.default_rng(0)
    spoken = [word for _, words in recordings for word in words]
    for number, (samples, words) in enumerate(recordings):
        others = [other for _, other in recordings[number:] + recordings[:number] if other != words]
        next_samples, next_words = recordings[(number + 1) % len(recordings)]
        level = 10 ** (-10 / 20) * float(np.sqrt(np.mean(samples**2)))
        noise = draw.normal(0, level, len(samples)).astype(np.float32)
        half = (len(words) + 1) // 2
        replaced = list(words)
        for place in draw.choice(len(words), max(1, len(words) // 4), replace=False):
            replaced[place] = str(draw.choice([word for word in spoken if word != words[place]]))
        pair = np.concatenate([samples, next_samples])
        yield "right", samples, words
        yield "right, in noise of 10 dB", samples + noise, words
        yield "right, two sentences", pair, words + next_words
        yield "of another sentence", samples, others[3 % len(others)]
        yield "one word in four replaced", samples, tuple(replaced)
        yield "a sentence missing", pair, words
        if len(words) > 1:
            yield "a half missing", samples, words[half:] if number % 2 else words[:half]


def _network() -> Hearing | None:
    """Return what hears phones; None where no phone recogniser is installed."""
    if find_installed_recogniser() is None:
        return None
    network, step = load_phone_recogniser(), PIECE_S * RATE_HZ

    def hear(samples: NDArray[np.float32]) -> NDArray[np.float64]:
        pieces = [network.log_posteriors(samples[at : at + step]) for at in range(0, len(samples), step)]
        return PhonePosteriors(np.concatenate(pieces), network.tokens).of_phones.astype(float)

    return hear


def _peak_mb() -> int:
    """Return the most memory that this process had (Linux); ``ru_maxrss`` may be that of the parent."""
    status = Path("/proc/self/status").read_text("utf-8")
    return round(int(status.partition("VmHWM:")[2].split()[0]) / 1024)


def _errors(found: list[Row], true: list[Row]) -> NDArray[np.float64]:
    """Return how far the starts of words are from the true ones; equal words that meet may be one of either."""
    pairs = SequenceMatcher(None, [row[0] for row in found], [row[0] for row in true], autojunk=False)
    return np.array(
        [
            abs(found[block.a + i][1] - true[block.b + i][1])
            for block in pairs.get_matching_blocks()
            for i in range(block.size)
        ]
    )


def _written(folder: Path, sentences: list[list[Row]], change: Change) -> tuple[Path, list[list[Row]]]:
    """Write the transcript of a case; return its file, and the true times of the sentences that it has."""
    draw = np.random.default_rng(1)
    kept = [rows for rows in sentences if draw.random() >= change.missing]
    path = folder / f"transcript.{change.form}"
    off = lambda: float(draw.normal(0, change.jitter_s)) + change.late_s  # noqa: E731
    if change.form == "txt":
        text = "\n".join(" ".join(word for word, *_ in rows) for rows in kept)
    elif change.form == "srt":
        cues = []
        for number, rows in enumerate(kept, 1):
            start_s = max(rows[0][1] + off(), 0)
            end_s = max(rows[-1][2] + off() + change.longer_s, start_s + 0.5)
            cues.append(f"{number}\n{_clock(start_s)} --> {_clock(end_s)}\n{' '.join(word for word, *_ in rows)}\n")
        text = "\n".join(cues)
    else:
        segments = []
        for rows in kept:
            words = []
            for word, true_start_s, true_end_s in rows:
                start_s = max(true_start_s + off(), 0)
                words.append({"word": f" {word}", "start": start_s, "end": max(true_end_s + off(), start_s)})
            segments.append({"start": words[0]["start"], "end": words[-1]["end"], "text": "", "words": words})
        text = json.dumps({"text": "", "segments": segments})
    path.write_text(text, encoding="utf-8")
    return path, kept


def _clock(time_s: float) -> str:
    ms = round(1000 * time_s)
    return f"{ms // 3_600_000:02}:{ms // 60_000 % 60:02}:{ms // 1000 % 60:02},{ms % 1000:03}"


if __name__ == "__main__":
    main()
