"""The phone recogniser: a network that says in every frame how probable each phone is, whoever speaks.

It is trained with connectionist temporal classification (CTC): a token is probable in a frame or two of the time in
which its phone is said, ``BLANK`` in all others.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from hashlib import sha256
from importlib import metadata, resources
from importlib.util import find_spec
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.sound.voice_activity import Stretch, find_sound, read_stretch
from lipmotion.types import Audio, JoinedRows, ParallelMap, TokenPosteriors
from lipmotion.types.audio import from_sixteen_bits
from lipmotion.units import PHONES
from lipmotion.units.ipa_phones import read_tokens

POSTERIOR_STEP = 2  # frames of 10 ms from one row of posteriors to the next
BLANK, WORD_BOUNDARY = "<blank>", "<wb>"
MIN_LOG_POSTERIOR = -16.0  # the logarithm of what is taken to be impossible
SHORT_FRAMES = 1500  # so little sound is recognised in this process: to start another one would take as long


LIBRARIES = {("linux", "x86_64"), ("linux", "aarch64"), ("darwin", "x86_64"), ("darwin", "arm64")}
"""Systems and processors that the package has a library for."""
PACKAGE, WEIGHTS = "hama", "asr_waveform.hama"
MIN_SAMPLES = 1600  # shorter sound is filled up with silence: the network has no row for it


class PhoneRecogniser:
    """The network of the package ``hama`` (Apache-2.0), which gives posteriors of tokens.

    tokens : phones in the International Phonetic Alphabet, ``BLANK`` and ``WORD_BOUNDARY``
    source : name and version, which ``pip install NAME==VERSION`` takes, and a digest of its weights: posteriors of
             another source are not what a model was trained on
    """

    def __init__(self) -> None:
        from hama.asr import ASRModel

        self._model = ASRModel()
        self.tokens = tuple(self._model.decoder_tokens)
        weights = (resources.files(PACKAGE) / "assets" / WEIGHTS).read_bytes()
        self.source = f"{PACKAGE} {metadata.version(PACKAGE)} {sha256(weights).hexdigest()[:12]}"

    def log_posteriors(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return natural logarithms of the posteriors of all tokens, every 20 ms [shape=(N, K)].

        samples : at 16 kHz, at most 10 s of them
        """
        filled = np.pad(samples, (0, max(0, MIN_SAMPLES - len(samples)))).astype(np.float32)
        values, rows = self._model.session.run(
            ["log_probs", "out_lengths"],
            {"waveform": filled[None], "waveform_lengths": np.array([len(filled)], np.int64)},
        )
        posteriors: NDArray[np.float32] = np.asarray(values, np.float32).reshape(-1, len(self.tokens))
        return posteriors[: int(rows[0])]


@cache
def find_installed_recogniser() -> str | None:
    """Return the name of the phone recogniser; None: it is not installed, or has no library for this machine."""
    has_library = (sys.platform, platform.machine()) in LIBRARIES
    return PACKAGE if has_library and find_spec(PACKAGE) is not None else None


@cache
def load_phone_recogniser() -> PhoneRecogniser:
    """Return the phone recogniser of this process, where it is installed; it is loaded once."""
    return PhoneRecogniser()


class FoundToken(NamedTuple):
    """A token on the most probable path, and its rows: from ``first`` to before ``end``."""

    token: str
    first: int
    end: int


@dataclass(frozen=True, eq=False)
class PhonePosteriors:
    """Posteriors of K tokens in a stretch of a recording, or in half precision in all of it."""

    values: NDArray[np.floating[Any]]  # natural logarithms, every ``POSTERIOR_STEP`` frames [shape=(N, K)]
    tokens: tuple[str, ...]

    @cached_property
    def of_phones(self) -> NDArray[np.float32]:
        """Logarithms of the posteriors of ``PHONES``, and last of none of them [shape=(N, 48)]."""
        summed = np.exp(self.values, dtype=np.float32) @ _sum_phones(self.tokens)
        return np.log(np.maximum(summed, np.finfo(np.float32).tiny))

    @cached_property
    def best_tokens(self) -> tuple[FoundToken, ...]:
        """The tokens of the path with the most probable token in every row, without blanks."""
        best = self.values.argmax(axis=1)
        bounds = pairwise([0, *(np.flatnonzero(np.diff(best)) + 1).tolist(), len(best)])
        tokens = (FoundToken(self.tokens[best[first]], first, end) for first, end in bounds if end)
        return tuple(each for each in tokens if each.token != BLANK)

    @property
    def has_phones(self) -> bool:
        """Whether a phone is on the best path."""
        return any(each.token != WORD_BOUNDARY for each in self.best_tokens)

    def phones_between(self, first: int, end: int) -> list[str]:
        """Return the phones of the best path that begin in some rows: from ``first`` to before ``end``."""
        tokens = [each.token for each in self.best_tokens if first <= each.first < end]
        return [phone for phone, _ in read_tokens(tokens)]

    def mean_posterior(self, first: int, end: int) -> float:
        """Return the mean posterior of the tokens of the best path that begin in some rows, 0 to 1; 0 without any."""
        peaks = [
            float(self.values[each.first : each.end].max())
            for each in self.best_tokens
            if first <= each.first < end and each.token != WORD_BOUNDARY
        ]
        return float(np.exp(peaks).mean()) if peaks else 0.0


class PosteriorStretch(NamedTuple):
    """Frames of a recording with sound in them, and the posteriors there."""

    stretch: Stretch
    posteriors: PhonePosteriors


def find_stretches(audio: AnalysedAudio, each: ParallelMap = map) -> list[PosteriorStretch]:
    """Return the posteriors in all stretches of sound of a recording; they are computed once."""

    def compute() -> list[PosteriorStretch]:
        tokens = load_phone_recogniser().tokens
        places = [(part, stretch) for part in audio.passages for stretch in find_sound(part.audio.log_energy)]
        chosen = each if sum(stretch.end - stretch.first for _, stretch in places) > SHORT_FRAMES else map
        sounds = (read_stretch(part.audio, stretch) for part, stretch in places)
        rows = chosen(infer_stretch, sounds)
        by_passage: dict[int, list[PosteriorStretch]] = {part.first: [] for part in audio.passages}
        for (part, stretch), values in zip(places, rows, strict=True):
            posteriors = PhonePosteriors(values.astype(np.float32), tokens)
            by_passage[part.first].append(PosteriorStretch(stretch, posteriors))
        if audio.is_passage:
            return by_passage[0]
        placed = []
        for part in audio.passages:
            part.audio.cached("posteriors", partial(by_passage.__getitem__, part.first))
            for (first, end), posteriors in by_passage[part.first]:
                start, stop = max(part.first + first, part.own.start), min(part.first + end, part.own.stop)
                skipped = -(-(start - part.first - first) // POSTERIOR_STEP)
                values = posteriors.values[skipped : skipped + -(-(stop - start) // POSTERIOR_STEP)]
                if len(values):
                    placed.append(PosteriorStretch(Stretch(start, stop), PhonePosteriors(values, tokens)))
        return placed

    return audio.cached("posteriors", compute)


def mean_posterior(stretches: Sequence[PosteriorStretch]) -> float:
    """Return the mean posterior of all phones that are found in some stretches, 0 to 1; 0 where there are none."""
    counts = [sum(each.token != WORD_BOUNDARY for each in posteriors.best_tokens) for _, posteriors in stretches]
    means = [posteriors.mean_posterior(0, len(posteriors.values)) for _, posteriors in stretches]
    return float(np.dot(counts, means) / max(sum(counts), 1))


def read_posteriors(audio: AnalysedAudio, each: ParallelMap = map) -> PhonePosteriors:
    """Return the posteriors in the whole of a recording; where there is no sound, nothing is said."""
    tokens = load_phone_recogniser().tokens
    return audio.cached("all posteriors", lambda: PhonePosteriors(np.asarray(_join_posteriors(audio, each)), tokens))


def _join_posteriors(audio: AnalysedAudio, each: ParallelMap) -> JoinedRows:
    tokens = load_phone_recogniser().tokens
    silence = np.full(len(tokens), MIN_LOG_POSTERIOR, np.float16)  # as stretches are computed
    silence[tokens.index(BLANK)] = 0
    rows, end, parts = -(-audio.frames // POSTERIOR_STEP), 0, list[NDArray[np.float16]]()
    for stretch, posteriors in find_stretches(audio, each):
        first = stretch.first // POSTERIOR_STEP
        if first < end:  # the last row of the one before
            parts[-1] = parts[-1][: first - end]
        parts += [np.broadcast_to(silence, (max(first - end, 0), len(tokens)))]
        parts += [posteriors.values[: rows - first].astype(np.float16)]
        end = first + len(parts[-1])
    return JoinedRows([*parts, np.broadcast_to(silence, (rows - end, len(tokens)))])


def infer_posteriors(audio: Audio, each: ParallelMap = map, *, dense: bool = True) -> TokenPosteriors:
    """Return the posteriors in a recording as the input of an engine.

    audio : an ``AnalysedAudio`` shares them with what recognises its phones
    dense : whether the values are an array; False: ``JoinedRows``
    """
    audio = analysed(audio)
    values: Any = read_posteriors(audio, each).values if dense else _join_posteriors(audio, each)
    return TokenPosteriors(values, load_phone_recogniser().source, mean_posterior(find_stretches(audio, each)))


def infer_stretch(samples: bytes) -> NDArray[np.float16]:
    """Return natural logarithms of the posteriors of a stretch of sound [shape=(N, K)].

    samples : 16-bit integers at 16 kHz
    """
    numbers = from_sixteen_bits(np.frombuffer(samples, "<i2"))
    return load_phone_recogniser().log_posteriors(numbers).astype(np.float16)


@cache
def _sum_phones(tokens: tuple[str, ...]) -> NDArray[np.float32]:
    """Return which phone each token is; several share it; the last column: none [shape=(K, 48)]."""
    table = np.zeros((len(tokens), len(PHONES) + 1), np.float32)
    for number, token in enumerate(tokens):
        phones = [phone for phone, _ in read_tokens([token])] if token not in (BLANK, WORD_BOUNDARY) else []
        for phone in phones:
            table[number, PHONES.index(phone)] += 1 / len(phones)
        if not phones:
            table[number, -1] = 1
    return table
