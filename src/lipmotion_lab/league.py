"""``lipmotion league``: rivals and our engines on the same recordings, in one table (docs/results/league.md).

A rival is a program outside the package: an adapter takes ``JOB.json ANSWER.json`` (extras/league/README.md).
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import subprocess
import sys
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lipmotion.corpora import Corpus
from lipmotion.errors import CorpusError, InputError, MissingDependencyError, shorten
from lipmotion.formats.sound import write_sound
from lipmotion.measures import curves
from lipmotion.measures.closures import REACH, find_closings, find_threshold, match_closings
from lipmotion.motion.frame_labels import is_away_from_speech
from lipmotion.pipeline.model import load_model
from lipmotion.pipeline.training.train import label_phones
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion.storage.files import atomic_file, make_folder
from lipmotion.storage.json_text import as_json, from_json, replace_nan
from lipmotion.types import Audio, Monitor, Span, Timeline, Unit, Utterance, silent_monitor, sub_monitor, with_progress
from lipmotion.types.motion import interpolate_rows
from lipmotion.units import Lexicon, is_silent
from lipmotion_lab.evaluation.evaluate import BILABIAL, ClipStatistic, divide_sums
from lipmotion_lab.report.page import FPS, FinishedPart, draw_mouths, write_html
from lipmotion_lab.report.section import Section, Table, read_columns, warn_of_few, write_text

Array = NDArray[np.float64]
CHANNELS = ("opening", "width")
TABLE = "rivals.json"
SOUND_HZ, GRID_HZ = 48_000, 100.0  # rate of the sound that rivals hear, and that at which their weights are compared
LEVEL, LEVEL_SHARE, LEVEL_WINDOW = 0.1, 95, SOUND_HZ // 50
"""Rivals have thresholds: the root mean square of the loudest twentieth of each recording is brought to this."""
LAGS_S, SMOOTHINGS_S = np.arange(-0.08, 0.33, 0.04), (0.0, 0.03, 0.06, 0.1)
SHUT_SHARES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)
"""What is tried of every rival: lags, smoothing (σ), and the share of its 95th percentile under which it is shut."""
SYNC_STEP_S, MAX_SYNC_S, RIDGE = 0.01, 5.0, 1e-3
FOLDS = 5
ONSET_REACH_S = 0.2  # a movement that begins nowhere within this time counts as an error of it
ABSENT = MissingDependencyError.exit_code  # exit code of an adapter whose rival is not installed


class RivalError(InputError):
    """A rival crashed, took too long, or answered nonsense."""


@dataclass(frozen=True)
class Rival:
    """A row of the table of adapters.

    run      : program and file of the adapter; ``{NAME:default}`` is the program in a variable of the environment
    settings : values that are tried, all with all, by name; the choice among them is made where nothing is reported
    given    : what it hears: ``sound``, or also ``phones``
    """

    name: str
    title: str
    run: tuple[str, ...]
    needs: str
    given: str = "sound"
    ours: bool = False
    settings: Mapping[str, Sequence[Any]] = field(default_factory=dict)

    def list_settings(self) -> list[dict[str, Any]]:
        """Return all settings that are tried. Raises MissingDependencyError: a variable in them is not set."""
        tried = []
        for row in itertools.product(*self.settings.values()):
            expanded = [os.path.expandvars(each) if isinstance(each, str) else each for each in row]
            if unset := [each for each in expanded if isinstance(each, str) and "$" in each]:
                raise MissingDependencyError(f"{unset[0]}: not set; {self.needs}")
            tried.append(dict(zip(self.settings, expanded, strict=True)))
        return tried


def read_rivals(folder: Path, only: Sequence[str] = ()) -> list[Rival]:
    """Return the rivals of a folder of adapters. Raises InputError: no such folder or rival, or a damaged table."""
    path = folder / TABLE
    try:
        table = from_json(path.read_bytes())
        rivals = [Rival(name, **row | {"run": tuple(row["run"])}) for name, row in table.items()]
    except FileNotFoundError as error:
        way_out = "give the folder extras/league of the sources (--adapters, or LIPMOTION_LEAGUE)"
        raise InputError(f"{path}: no such file; {way_out}") from error
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: not a table of rivals ({error}); see the README.md in extras/league") from error
    if unknown := sorted(set(only) - {rival.name for rival in rivals}):
        raise InputError(f"no rival {unknown[0]!r}; there are: {', '.join(rival.name for rival in rivals)}")
    return [rival for rival in rivals if not only or rival.name in only]


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording with what was measured of its speaker's lips.

    time_s, original : time, opening and width of the N frames with a face [shape=(N,), (N, 2)]
    phones           : start and end in seconds, and phone; silence is ""
    """

    utterance: Utterance
    sound: Path
    time_s: Array
    original: Array
    phones: list[tuple[float, float, str]]

    def list_spans(self, *, lips: bool) -> list[tuple[float, float]]:
        """Return the times of p, b and m, or of all other phones."""
        return [(start, end) for start, end, phone in self.phones if phone and (phone in BILABIAL) == lips]


def load_recordings(corpus: Corpus, names: Sequence[str], work: Path, monitor: Monitor) -> list[Recording]:
    """Return recordings, their sound as a file in ``work``. Raises CorpusError: no lips were measured in one."""
    from scipy.signal import resample_poly

    phones, recordings = open_recogniser(load_model().phones), []
    make_folder(work / "sound")
    for utterance in with_progress([corpus.utterance(name) for name in names], "recordings", monitor):
        motion, seen = utterance.track.motion, np.asarray(utterance.track.seen)
        missing = [name for name in CHANNELS if name not in motion.names]
        if missing or seen.sum() < 2 * REACH:
            what = f"no {', '.join(missing)}" if missing else f"a face in {seen.sum()} frames"
            raise CorpusError(
                f"{corpus.path}: {utterance.name} has {what}, required the lips of a filmed face; prepare videos, or "
                "leave the recording out"
            )
        content = np.asarray(utterance.audio.samples).tobytes() + repr((utterance.words, utterance.phones)).encode()
        sound, timed = (
            work / "sound" / f"{utterance.name}-{zlib.crc32(content):08x}.{kind}" for kind in ("wav", "json")
        )
        if not sound.exists():
            samples = resample_poly(np.asarray(utterance.audio.samples, float), SOUND_HZ, utterance.audio.rate_hz)
            powers = np.square(samples[: len(samples) // LEVEL_WINDOW * LEVEL_WINDOW]).reshape(-1, LEVEL_WINDOW)
            loudest = np.sqrt(np.percentile(powers.mean(axis=1), LEVEL_SHARE))
            write_sound(sound, Audio((samples * LEVEL / max(loudest, 1e-9)).astype(np.float32), SOUND_HZ))
        if not timed.exists():
            units = label_phones(utterance, phones, Lexicon())
            rows = [(s.start_s, s.end_s, "" if is_silent(s.label.phone) else s.label.phone) for s in units]
            write_text(timed, as_json(rows))
        time_s = motion.time_s[seen]
        original = np.stack([motion[name][seen] for name in CHANNELS], axis=1).astype(float)
        spoken = [(start, end, phone) for start, end, phone in from_json(timed.read_bytes())]
        recordings.append(Recording(utterance, sound, time_s, original, spoken))
    return recordings


@dataclass(frozen=True, eq=False)
class RivalAnswer:
    """What a rival made of a recording: its weights [shape=(T, W)], 100 rows a second; processor seconds, or NaN."""

    names: tuple[str, ...]
    weights: Array
    seconds: float


def ask(
    rival: Rival, recordings: Sequence[Recording], adapters: Path, work: Path, limit_s: float
) -> list[list[RivalAnswer]]:
    """Return the answers of a rival by settings and recording; kept in ``work``, a file for each recording.

    limit_s : seconds after which the job is ended
    Raises MissingDependencyError: it is not installed. Raises RivalError: it crashed, or answered nonsense.
    """
    program, *scripts = rival.run
    if program.startswith("{"):
        variable, _, default = program.strip("{}").partition(":")
        program = os.environ.get(variable) or (sys.executable if default == "python" else default)
    command, settings = [program, *(str(adapters / script) for script in scripts)], rival.list_settings()
    contents = [Path(word).read_bytes() for word in command if Path(word).parent == adapters]
    key = hashlib.sha256(b"".join([*contents, json.dumps(settings, sort_keys=True).encode()])).hexdigest()[:8]
    folder = work / "answers" / f"{rival.name}-{key}"
    make_folder(folder)
    files = [folder / f"{each.sound.stem}.json" for each in recordings]
    missing = [(each, file) for each, file in zip(recordings, files, strict=True) if not file.exists()]
    if missing:
        content = _run(rival, command, [each for each, _ in missing], folder, limit_s)
        for each, _ in missing:
            read_rival_answers(rival, each, content.get(each.utterance.name))  # nothing is kept before it is checked
        for each, file in missing:
            write_text(file, as_json(content[each.utterance.name]))
    by_recording = [
        read_rival_answers(rival, each, from_json(file.read_bytes()))
        for each, file in zip(recordings, files, strict=True)
    ]
    tried = [list(answers) for answers in zip(*by_recording, strict=True)]
    if any(answer.names != answers[0].names for answers in tried for answer in answers):
        raise RivalError(f"{rival.title}: recordings have weights of different names, required the same in all")
    return tried


def _run(
    rival: Rival, command: Sequence[str], recordings: Sequence[Recording], folder: Path, limit_s: float
) -> dict[str, Any]:
    """Return what an adapter answers, by recording; what it prints goes to a file. Raises as ``ask``."""
    rows: list[dict[str, Any]] = []
    for each in recordings:
        audio = each.utterance.audio
        rows.append({"name": each.utterance.name, "sound": str(each.sound), "duration_s": audio.duration_s})
        if rival.given == "phones":
            rows[-1]["phones"] = [[phone, start_s, end_s] for start_s, end_s, phone in each.phones]
    job, answered = folder / "job.part", folder / "answer.part"
    write_text(job, as_json({"rate_hz": SOUND_HZ, "recordings": rows, "settings": rival.list_settings()}))
    answered.unlink(missing_ok=True)
    command = [*command, str(job), str(answered)]
    with (folder / "log.txt").open("wb") as log:  # not a pipe, which a program of the rival's could hold open
        try:
            code = subprocess.run(command, stdout=log, stderr=log, timeout=limit_s, check=False).returncode
        except (FileNotFoundError, PermissionError) as error:
            raise MissingDependencyError(f"{command[0]} cannot be run; {rival.needs}") from error
        except subprocess.TimeoutExpired as error:
            raise RivalError(
                f"{rival.title}: not finished after {limit_s:g} s and ended; allow more with --limit, or leave it out"
            ) from error
    if code == ABSENT:
        raise MissingDependencyError(rival.needs)
    if code:
        lines = (folder / "log.txt").read_text("utf-8", errors="replace").strip().splitlines() or ["it printed nothing"]
        raise RivalError(f"{rival.title}: exit code {code} ({shorten(lines[-1])}); see {folder / 'log.txt'}")
    try:
        return dict(from_json(answered.read_bytes()))
    except (OSError, ValueError, TypeError) as error:
        raise RivalError(f"{rival.title}: no readable answer ({error}); see {folder / 'log.txt'}") from error


def read_rival_answers(rival: Rival, recording: Recording, content: Any) -> list[RivalAnswer]:
    """Return the answers to a recording by settings, checked. Raises RivalError."""
    about, count = f"{rival.title}, {recording.utterance.name}", len(rival.list_settings())
    answers, needed_s = [], recording.utterance.audio.duration_s
    if not isinstance(content, list) or len(content) != count:
        raise RivalError(f"{about}: no list of {count} answers, one for each settings")
    for each in content:
        try:
            time_s, names = np.array(each["times"], float), tuple(sorted(each["weights"]))
            weights = np.stack([np.array(each["weights"][name], float) for name in names], axis=1)
            seconds = float(each.get("seconds", np.nan))
        except (TypeError, KeyError, ValueError, AttributeError) as error:
            reason = f"{type(error).__name__}: {error}"
            raise RivalError(f"{about}: not an answer ({reason}); required times, weights") from error
        if len(time_s) != len(weights) or len(time_s) < 2:
            raise RivalError(f"{about}: {len(time_s)} times and {len(weights)} values, required as many, two or more")
        if not (np.isfinite(time_s).all() and np.isfinite(weights).all()):
            raise RivalError(f"{about}: values that are not finite, required numbers")
        first_s, last_s = float(time_s[0]), float(time_s[-1])
        if (np.diff(time_s) < 0).any() or not -1 <= first_s <= needed_s / 2 <= last_s <= needed_s + 1:
            required = f"required rising from about 0 to {needed_s:.2f} s"
            raise RivalError(f"{about}: times from {first_s:.2f} to {last_s:.2f} s, {required}")
        at_s = np.arange(int(needed_s * GRID_HZ) + 1) / GRID_HZ
        values = np.stack([np.interp(at_s, time_s, column) for column in weights.T], axis=1)
        answers.append(RivalAnswer(names, values, seconds))
    return answers


@dataclass(frozen=True, eq=False)
class Choice:
    """How the weights of a rival become opening and width, chosen on other recordings than those reported.

    setting      : number of the settings;  lag_s : by which the rival is late;  smoothing_s : σ of a Gaussian
    coefficients : of the weights and of a constant [shape=(W + 1, 2)];  shut : the opening under which it is closed
    """

    setting: int
    lag_s: float
    smoothing_s: float
    coefficients: Array
    shut: float = 0.0
    score: float = -2.0


def prepare_weights(answer: RivalAnswer, smoothing_s: float) -> Array:
    """Return the smoothed weights of an answer, with a constant."""
    from scipy.ndimage import gaussian_filter1d

    weights = answer.weights
    if smoothing_s:
        weights = gaussian_filter1d(weights, smoothing_s * GRID_HZ, axis=0, mode="nearest")
    return np.concatenate([weights, np.ones((len(weights), 1))], axis=1)


def fit_map(rows: Array, original: Array) -> Array:
    """Return the coefficients by ridge regression, which move as widely as the speakers do [shape=(W + 1, 2)]."""
    square = rows.T @ rows
    penalty = RIDGE * np.trace(square) / len(square) * np.eye(len(square))
    coefficients: Array = np.linalg.solve(square + penalty, rows.T @ original)
    made = rows @ coefficients
    gain = original.std(axis=0) / np.maximum(made.std(axis=0), 1e-6 + 0.1 * original.std(axis=0))
    coefficients *= gain
    coefficients[-1] += original.mean(axis=0) - gain * made.mean(axis=0)
    return coefficients


def synchronise(recording: Recording, motion: Array, lag_s: float, limit_s: float) -> Array:
    """Return motion [shape=(T, 2)] in the frames of a recording, moved by up to ``limit_s`` to fit its opening best."""
    shifts = np.arange(-limit_s, limit_s + 1e-9, SYNC_STEP_S) if limit_s else np.zeros(1)
    times = recording.time_s[:, None] + lag_s + shifts
    moved = interpolate_rows(motion[:, :1], GRID_HZ, times.ravel()).reshape(times.shape)
    return interpolate_rows(motion, GRID_HZ, times[:, np.argmax(curves.correlation(moved, recording.original[:, :1]))])


def choose(
    tried: Sequence[Sequence[RivalAnswer]], recordings: Sequence[Recording], numbers: Sequence[int], limit_s: float
) -> Choice:
    """Return the choice with the highest mean correlation of opening on recordings of some numbers.

    tried : answers to all recordings, by settings. Answers that have opening and width are taken as they are
    """
    chosen, choice, made = [recordings[n] for n in numbers], Choice(0, 0.0, 0.0, np.zeros((1, 2))), list[Array]()
    original = np.concatenate([each.original for each in chosen])
    opened = [each.original[:, :1] for each in chosen]
    own = set(CHANNELS) <= set(tried[0][0].names)
    lags_s, smoothings_s = ([0.0], [0.0]) if own else (LAGS_S.tolist(), SMOOTHINGS_S)
    for (setting, answers), smoothing_s in itertools.product(enumerate(tried), smoothings_s):
        weights = [prepare_weights(answers[n], smoothing_s) for n in numbers]
        for lag_s in lags_s:
            if own:
                coefficients = np.array(
                    [[name == each for each in CHANNELS] for name in (*answers[0].names, "")], float
                )
            else:
                placed = (interpolate_rows(w, GRID_HZ, r.time_s + lag_s) for w, r in zip(weights, chosen, strict=True))
                coefficients = fit_map(np.concatenate(list(placed)), original)
            moved = [synchronise(r, w @ coefficients, lag_s, limit_s) for w, r in zip(weights, chosen, strict=True)]
            score = float(curves.correlate_clips([each[:, :1] for each in moved], opened)[0])
            if score > choice.score + 1e-4:
                choice, made = Choice(setting, lag_s, smoothing_s, coefficients, score=score), moved
    level = float(np.percentile(np.concatenate([each[:, 0] for each in made]), 95))
    counts = {
        share: np.sum([count_closings(each, m, share * level)[0] for each, m in zip(chosen, made, strict=True)], axis=0)
        for share in SHUT_SHARES
    }
    return replace(choice, shut=level * max(counts, key=lambda share: np.nan_to_num(_compute_f1(counts[share]))))


def count_closings(recording: Recording, made: Array, shut: float) -> tuple[Array, Array]:
    """Return matched, missed and false closings, of all and of p, b and m [each shape=(3,)].

    Of p, b and m: missed are the speaker's closings there, false are generated ones in phones without one.
    """
    opening, own = recording.original[:, 0], find_threshold([recording.original[:, 0]])
    original, generated = find_closings(opening, own), find_closings(made[:, 0], shut)
    pairs = match_closings(generated, original)
    matched = [o for _, o in pairs]
    frame_s = float(np.median(np.diff(recording.time_s)))

    def mark_in(frames: NDArray[np.intp], spans: Sequence[tuple[float, float]], margin_s: float) -> NDArray[np.bool_]:
        return ~is_away_from_speech(recording.time_s[frames], spans, margin_s)

    lips, other = recording.list_spans(lips=True), recording.list_spans(lips=False)
    wanted = original[mark_in(original, lips, frame_s)]
    false = np.setdiff1d(generated, [g for g, _ in pairs]).astype(int)
    false = false[mark_in(false, other, 0.0) & ~mark_in(false, lips, frame_s)]
    hits = int(np.isin(wanted, matched).sum())
    everything = np.array([len(pairs), len(original) - len(pairs), len(generated) - len(pairs)], float)
    return everything, np.array([hits, len(wanted) - hits, len(false)], float)


def _compute_f1(counts: Array) -> float:
    matched, missed, false = counts
    return divide_sums(np.array([2 * matched, 2 * matched + missed + false]))


def measure_onsets(recording: Recording, made: Array, shut: float) -> Array:
    """Return the sum of errors, in ms, with which movements of the mouth begin, and their number [shape=(2,)]."""
    threshold, frame_s = find_threshold([recording.original[:, 0]]), float(np.median(np.diff(recording.time_s)))
    original = find_closings(-recording.original[:, 0], -threshold)  # the first open frame after a closed one
    generated = find_closings(-made[:, 0], -shut)
    pairs = match_closings(generated, original, round(ONSET_REACH_S / frame_s))
    errors = sum(abs(recording.time_s[g] - recording.time_s[o]) for g, o in pairs)
    return 1000 * np.array([errors + ONSET_REACH_S * (len(original) - len(pairs)), len(original) / 1000])


def measure(recordings: Sequence[Recording], made: Sequence[tuple[Array, float, float]]) -> dict[str, ClipStatistic]:
    """Return the figures of one rival by name, each a sum over recordings; made: motion, threshold, seconds."""
    sums = []
    for recording, (motion, shut, seconds) in zip(recordings, made, strict=True):
        acc, width = curves.correlation(motion, recording.original)
        everything, lips = count_closings(recording, motion, shut)
        speech = ~is_away_from_speech(recording.time_s, [s[:2] for s in recording.phones if s[2]], 0.0)
        speech |= ~speech.any()  # nothing is spoken: all of it
        both = (motion[:, 0], recording.original[:, 0])
        row: dict[str, Any] = {"acc": [acc, 1], "width": [width, 1], "f1": everything, "lips": lips}
        row["strength"] = [np.percentile(each[speech], 98) for each in both]
        row["jerk"] = [np.abs(np.diff(each, 3)).sum() for each in both]
        row["onset"] = measure_onsets(recording, motion, shut)
        row["seconds"] = [seconds, recording.utterance.audio.duration_s]
        sums.append({name: np.array(each) for name, each in row.items()})
    counted = {"f1": _compute_f1, "lips": _compute_f1}
    return {name: ClipStatistic([row[name] for row in sums], counted.get(name, divide_sums)) for name in sums[0]}


def split_choices(reported: int, choosing: int) -> Iterator[tuple[list[int], list[int]]]:
    """Yield numbers of recordings to choose on, and to report; those to choose on stand after the others, if any.

    Without recordings to choose on: folds of those reported. Raises InputError: a single recording.
    """
    everything = list(range(reported))
    if choosing:
        yield list(range(reported, reported + choosing)), everything
        return
    if reported < 2:
        raise InputError("1 recording, required two or more, to choose on one and to report the other; or --choose")
    for fold in range(min(FOLDS, reported)):
        held = everything[fold::FOLDS]
        yield [n for n in everything if n not in held], held


@dataclass(frozen=True, eq=False)
class Standing:
    """What one rival did: its motion of each recording, its figures, and what was chosen of it in every fold."""

    rival: Rival
    made: Sequence[Array]
    figures: Mapping[str, ClipStatistic]
    chosen: Sequence[Mapping[str, Any]]


def play(
    rival: Rival, tried: Sequence[Sequence[RivalAnswer]], recordings: Sequence[Recording], reported: int, sync_s: float
) -> Standing:
    """Return what a rival does on the first ``reported`` recordings, of its answers by settings and recording."""
    settings = rival.list_settings()
    done, chosen = dict[int, tuple[Array, float, float]](), []
    for numbers, held in split_choices(reported, len(recordings) - reported):
        choice = choose(tried, recordings, numbers, sync_s)
        shown = {k: Path(v).name if isinstance(v, str) else v for k, v in settings[choice.setting].items()}
        about = {"settings": shown, "lag_ms": round(1000 * choice.lag_s)}
        chosen.append(about | {"smoothing_ms": round(1000 * choice.smoothing_s), "acc_there": round(choice.score, 3)})
        for n in held:
            answer = tried[choice.setting][n]
            motion = prepare_weights(answer, choice.smoothing_s) @ choice.coefficients
            done[n] = synchronise(recordings[n], motion, choice.lag_s, sync_s), choice.shut, answer.seconds
    made = [done[n] for n in range(reported)]
    return Standing(rival, [motion for motion, *_ in made], measure(recordings[:reported], made), chosen)


@dataclass(frozen=True, eq=False)
class League:
    """The standings, best first; why rivals are absent, or failed, by title; the recordings, and texts on them."""

    standings: Sequence[Standing]
    absent: Mapping[str, str]
    failed: Mapping[str, str]
    recordings: Sequence[Recording]
    about: Mapping[str, str]


def run_rivals(  # noqa: PLR0913
    corpus: Corpus,
    adapters: Path,
    work: Path,
    *,
    choosing: Corpus | None = None,
    only: Sequence[str] = (),
    sync_s: float = 0.06,
    limit_s: float = 600.0,
    monitor: Monitor = silent_monitor,
) -> League:
    """Return how rivals, and our engines, move the lips of the same recordings.

    adapters : the folder ``extras/league``, with a table of rivals
    work     : answers are kept there: a run that was stopped goes on
    choosing : another corpus, on whose list ``val`` (without one: on all) settings are chosen. None: the corpus's own
               ``val``, and its ``test`` is reported; without both lists, in folds over its recordings
    sync_s   : each recording may be moved by so much to fit best, alike for all; limit_s: longest time of a job
    Raises InputError: no adapters, or too few recordings. Raises CorpusError: no lips in a recording.
    """
    if not (0 <= sync_s <= MAX_SYNC_S and limit_s > 0):
        found, required = f"{1000 * sync_s:g} ms, {limit_s:g} s for a rival", f"0 to {1000 * MAX_SYNC_S:g} ms, over 0 s"
        raise InputError(f"recordings may be moved by up to {found}; required {required}")
    rivals, work, loading = read_rivals(adapters, only), work.resolve(), sub_monitor(monitor, 0, 0.3)
    own = choosing is None and corpus.names("val") and corpus.names("test")
    reported, other = corpus.names("test" if own else None), corpus if own else choosing
    names = () if other is None else other.names("val") or other.names()
    recordings = load_recordings(corpus, reported, work, loading)
    if other is not None:
        recordings += load_recordings(other, names, work / "choosing", loading)
    next(split_choices(len(reported), len(names)))
    stems = [each.sound.stem for each in recordings]
    if both := sorted({*stems[: len(reported)]} & {*stems[len(reported) :]}):
        raise InputError(f"{both[0]} is to choose on and is reported, required others; give another corpus to --choose")
    standings, absent, failed = [], {}, {}
    for rival in with_progress(rivals, "rivals", sub_monitor(monitor, 0.3, 1)):
        try:
            tried = ask(rival, recordings, adapters.resolve(), work, limit_s)
            standings.append(play(rival, tried, recordings, len(reported), sync_s))
        except MissingDependencyError as error:
            absent[rival.title] = str(error)
        except RivalError as error:
            failed[rival.title] = str(error)
    standings.sort(key=lambda each: -each.figures["acc"].value)
    chosen = f"{len(names)} other recordings" if names else "folds of these recordings"
    about = {"recordings": f"{len(reported)} of {corpus.path.resolve().name}", "settings chosen on": chosen}
    about |= {"moved to fit best, all alike": f"by up to {1000 * sync_s:g} ms"}
    return League(standings, absent, failed, recordings[: len(reported)], about)


SUBTITLE = "Rivals and our engines on the same filmed recordings."
HOW_TO_READ = (
    "Weights of a rival become opening and width by a linear map that moves as widely as the speakers do. The map, its "
    "lag, its smoothing, when lips count as closed, and the rival's settings are those with which it did best on "
    "recordings that are not reported here. What answers in opening and width is taken as it is. Small: 95 % "
    "bootstrap intervals over recordings."
)
PART, INSTANTS, SHOWN_S = "league", 6, 6.0
"""Folder of the report; pictures of each system, and the length of what is shown."""


def describe_league(league: League) -> Section:
    """Return what is said of a league: its table, against the best rival, and what was found."""
    rows: dict[str, dict[str, Any]] = {}
    rivals = (each for each in league.standings if not each.rival.ours and each.rival.given == "sound")
    best = next(rivals, None)  # of those that hear sound alone
    for each in league.standings:
        row: dict[str, Any] = {"given": each.rival.given}
        for name, figure in each.figures.items():
            row |= {name: figure.value, f"{name}_95": figure.compute_interval(0)}
            if best is not None and best is not each:
                row[f"{name}_gain_95"] = figure.compute_gain(best.figures[name], 0)
        rows[each.rival.title] = replace_nan(row)
    verdict = "nothing could be compared"
    if league.standings:
        first = league.standings[0]
        verdict = f"Best: {first.rival.title}, opening {first.figures['acc'].value:.3f}"
        if best is not None and best is not first:
            low, high = first.figures["acc"].compute_gain(best.figures["acc"], 0)
            verdict += f"; {low:+.3f} to {high:+.3f} more than the best rival, {best.rival.title}"
    lips = int(sum(counts[:2].sum() for counts in league.standings[0].figures["lips"].sums)) if league.standings else 0
    about = ", ".join(f"{key}: {value}" for key, value in league.about.items())
    title, columns = f"recorded closings in p, b, m: {lips}", read_columns("league")
    table = Table("standings", title, columns, rows, best.rival.title if best else "")
    words = warn_of_few(len(league.recordings))
    for title, reasons in (("Not installed", league.absent), ("Failed", league.failed)):
        words |= {title: [f"{name}: {reason}" for name, reason in reasons.items()]} if reasons else {}
    return Section("The league", about, verdict, words, table)


def write_league(league: League, folder: Path) -> dict[str, Any]:
    """Write the page of a league, with its pictures and all figures, to a folder; return the figures."""
    section, part = describe_league(league), folder / PART
    names = [each.utterance.name for each in league.recordings]
    accs = {each.rival.title: [acc for acc, _ in each.figures["acc"].sums] for each in league.standings}
    content = {
        "about": league.about,
        "best_rival": section.table.reference or None,
        "rivals": section.table.rows,
        "absent": league.absent,
        "failed": league.failed,
        "chosen": {each.rival.title: each.chosen for each in league.standings},
        "each": {title: dict(zip(names, of, strict=True)) for title, of in accs.items()},
    }
    figures: dict[str, Any] = replace_nan(content)
    section.write_tables(part / "tables")
    write_text(part / "figures.json", as_json(figures) + "\n")
    record = {"pictures": list(_draw_mouths(league, part)), "stamp": league.about}
    finished = [FinishedPart(PART, record, section)]
    page = write_html(
        "The league", league.about, finished, league.absent, league.failed, subtitle=SUBTITLE, how_to_read=HOW_TO_READ
    )
    write_text(folder / "index.html", page)
    return figures


def _draw_mouths(league: League, folder: Path) -> Iterator[dict[str, str]]:
    """Write a strip of mouths for the speaker and each system, at wide and closed lips where most p, b and m are."""
    counts = {
        (number, begin_s): sum(begin_s <= start and end <= begin_s + SHOWN_S for start, end in lips)
        for number, lips in enumerate(each.list_spans(lips=True) for each in league.recordings)
        for begin_s in (0.0, *(start for start, _ in lips))
    }
    number, begin_s = max(counts, key=lambda place: counts[place])
    recording = league.recordings[number]
    seen = np.flatnonzero((recording.time_s >= begin_s) & (recording.time_s < begin_s + SHOWN_S))
    extremes = (np.argmax, np.argmin)
    parts = [part for part in np.array_split(seen, INSTANTS) if len(part)]
    frames = [part[extremes[n % 2](recording.original[part, 0])] for n, part in enumerate(parts)]
    silence = Timeline((Span(0.0, len(frames) / FPS, Unit("sil")),))
    made = {each.rival.title: each.made[number] for each in league.standings}
    for place, (name, values) in enumerate(({"recorded": recording.original} | made).items()):
        pictures = list(draw_mouths(values[frames], CHANNELS, silence))[: len(frames)]
        with atomic_file(folder / f"{place}.png") as unfinished:
            Image.fromarray(np.concatenate(pictures, axis=1)).reduce(2).save(unfinished, format="png")
        yield {"file": f"{place}.png", "caption": name}
