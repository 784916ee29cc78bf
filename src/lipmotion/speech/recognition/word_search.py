"""The search for English words in a recording: which are recognised, and which of them are used."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, MissingDependencyError
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import LogLikelihoods, UnitLoop, decode_path, penalise, wrap_log_likelihoods
from lipmotion.speech.features.analysed_audio import AnalysedAudio
from lipmotion.speech.recognition.general import NOISES
from lipmotion.speech.recognition.network.beam_search import decode_words, load_english, score_stretch
from lipmotion.speech.recognition.network.posteriors import (
    POSTERIOR_STEP,
    WORD_BOUNDARY,
    PhonePosteriors,
    PosteriorStretch,
)
from lipmotion.speech.recognition.recognised_speech import (
    FORMS,
    AlignedWords,
    LabelledFrames,
    LabelledStretch,
    RecognisedWord,
    align_recognised_words,
    label_words,
    normalise_word,
    splice,
    weigh_densities,
    weigh_phones,
)
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.speech.sound.voice_activity import Stretch, find_sound, read_stretch
from lipmotion.types import ParallelMap
from lipmotion.units import PHONES, SILENCE, Lexicon, Pronunciation, is_silent
from lipmotion.units.lexicon import find_english_data
from lipmotion.units.phones import count_phone_edits


class FoundWord(NamedTuple):
    """A word in lower case, and its posterior probability among all words of the search, 0 to 1."""

    text: str
    posterior: float


VARIANT = re.compile(r"\(\d+\)$")
"""The number of a pronunciation behind a word."""
OPTIONS = {"fwdflat": False, "maxhmmpf": 10_000}
"""One pass over the tree of all words finds more phones, and faster, than with a second one over the words that it
found (docs/decisions/recognition.md)."""
_LOCK = threading.Lock()
"""A decoder works on one recording at a time."""


def spot_words(samples: bytes) -> tuple[FoundWord, ...]:
    """Return the words that are recognised in a stretch of sound; none if there are none.

    samples : 16-bit integers at 16 kHz
    The words are those of the best path of the search. Their posteriors are those of the best path through its lattice,
    0 where that has another word: it finds fewer words, but knows how many others were possible.
    Raises MissingDependencyError: pocketsphinx is not installed, or without its language model.
    """
    decoder = _decoder()
    with _LOCK:
        decoder.reinit_feat()  # else its estimate of the noise depends on what it decoded before
        decoder.start_utt()
        if samples:
            decoder.process_raw(samples, no_search=False, full_utt=True)
        found = _segments(decoder)
        decoder.end_utt()
        lattice = _segments(decoder)
    words = []
    for one in found:
        same = (two for two in lattice if one.word == two.word and max(one.first, two.first) <= min(one.last, two.last))
        words.append(FoundWord(one.word, max((two.posterior for two in same), default=0.0)))
    return tuple(words)


class _Segment(NamedTuple):
    word: str
    first: int
    last: int
    posterior: float


def _segments(decoder: Any) -> list[_Segment]:
    """Return the words of the decoder's present best path, and their frames."""
    entries = decoder.seg() if decoder.hyp() is not None else ()
    return [
        _Segment(VARIANT.sub("", entry.word), entry.start_frame, entry.end_frame, min(max(entry.prob, 0.0), 1.0))
        for entry in entries
        if not is_filler(entry.word)
    ]


def is_filler(word: str) -> bool:
    """Return whether an entry of pocketsphinx's dictionaries is silence or noise: ``<sil>``, ``[NOISE]``."""
    return word[:1] in ("<", "[", "+")


@cache
def _decoder() -> Any:
    """Return the decoder of this process; it is loaded once, in 0.2 s."""
    folder = find_english_data()
    try:
        from pocketsphinx import Decoder

        return Decoder(
            hmm=str(folder / "en-us"),
            lm=str(folder / "en-us.lm.bin"),
            dict=str(folder / "cmudict-en-us.dict"),
            samprate=SPEECH_RATE_HZ,
            loglevel="FATAL",
            **OPTIONS,
        )
    except (ImportError, RuntimeError) as error:
        raise MissingDependencyError(
            f"words are recognised by pocketsphinx and its language model ({error}): pip install pocketsphinx"
        ) from error


WORD_FIT, STRETCH_FIT = -2.0, -1.5
"""Words are believed from the first fit on, all words of a stretch from the second one on (``AlignedWords.fits``)."""
WORD_BONUS = 2.0
"""Where words are not believed, their phones are still more probable than others, by so many nats a frame."""
FIT_WEIGHT, POSTERIOR_WEIGHT, CONSTANT = 0.62, 3.4, -1.9
MIN_FIT, MAX_FIT = -4.0, 1.0
"""Coefficients of the confidence; fits count within these limits."""
SHORT_FRAMES = 3000
"""The words of so little sound are recognised in this process: to start another one would take as long."""
DICTIONARY = Lexicon()
"""Words that were recognised are in the dictionary."""


class WordsInStretches(NamedTuple):
    """Stretches of sound, and the words that are found in each of them, as soon as they are known."""

    stretches: Sequence[Stretch]
    words: Iterable[Sequence[FoundWord]]


def begin_decoding(audio: AnalysedAudio, each: ParallelMap = map) -> WordsInStretches:
    """Return the words in all stretches of sound of a recording; where ``each`` starts processes, they begin now."""
    stretches = find_sound(audio.log_energy)
    each = each if sum(stretch.end - stretch.first for stretch in stretches) > SHORT_FRAMES else map
    return WordsInStretches(stretches, each(spot_words, (read_stretch(audio, stretch) for stretch in stretches)))


@dataclass(frozen=True, eq=False)
class WordSearch:
    """The search for words in one recording of T frames, beside the phones that are recognised without words.

    loop      : the network of phones without words
    free      : log likelihoods of the recording, in the search of phones without words
    aligning  : log likelihoods for the alignment of words
    path      : the density of every frame on the best path of phones without words [shape=(T,)]
    loud      : frames that are too loud for silence [shape=(T,)]
    believing : whether all words are believed
    """

    hmm: UnitHmm
    loop: UnitLoop
    free: LogLikelihoods
    aligning: LogLikelihoods
    path: NDArray[np.intp]
    loud: NDArray[np.bool_]
    believing: bool = False

    def words_of(self, spoken: WordsInStretches) -> tuple[list[LabelledStretch], list[RecognisedWord]]:
        """Return the stretches in which words were recognised, with their phones, and these words.

        spoken : of ``begin_decoding``
        Raises MissingDependencyError: as ``words_in``.
        """
        parts, recognised = list[LabelledStretch](), list[RecognisedWord]()
        for stretch, words in zip(spoken.stretches, spoken.words, strict=True):
            here, fits = self._part(stretch, [word.text for word in words], len(recognised))
            parts += here
            recognised += [
                RecognisedWord(word.text, score_words(fit, word.posterior))
                for word, fit in zip(words, fits, strict=True)
            ]
        return parts, recognised

    def _part(
        self, stretch: Stretch, words: Sequence[str], first_word: int
    ) -> tuple[list[LabelledStretch], list[float]]:
        """Return the frames of a stretch that its words decide, with their phones, and the fit of each word."""
        if not words:
            return [], []
        values = self.aligning.stretch(*stretch)
        aligned = _align(self.hmm, values, self.loud[slice(*stretch)], words, DICTIONARY)
        if aligned is None:
            return [], [MIN_FIT] * len(words)
        fits, fit = aligned.fits(values, self.path[slice(*stretch)])
        believed = np.full(len(words), self.believing or fit > STRETCH_FIT) | (fits > WORD_FIT)
        decided = list(label_words(aligned, stretch, believed, first_word))
        if not believed.all():
            # phones as they are recognised if those of words in it are more probable than others
            values = self.free.stretch(*stretch) + weigh_phones(self.hmm, aligned, WORD_BONUS)
            path = self.loop.network.best_path(wrap_log_likelihoods(values))
            decided = [(stretch, splice(recognise_free(self.loop, path, stretch.first), decided, stretch.end))]
        return decided, fits.tolist()


def score_words(fit: float, posterior: float) -> float:
    """Return the probability that a word is right, 0 to 1: by logistic regression (docs/decisions/recognition.md).

    fit       : of the word (``AlignedWords.fits``), in nats
    """
    score = FIT_WEIGHT * min(max(fit, MIN_FIT), MAX_FIT) + POSTERIOR_WEIGHT * posterior + CONSTANT
    return float(1 / (1 + np.exp(-score)))


def recognise_free(loop: UnitLoop, path: NDArray[np.intp], first: int = 0) -> list[LabelledFrames]:
    """Return the phones of a path through a loop [shape=(T,)] whose first frame is ``first``; noises are silence."""
    phones, starts = decode_path(loop, path)
    return [
        LabelledFrames(first + int(start), SILENCE if phone in NOISES else phone)
        for phone, start in zip(phones, starts[:-1], strict=True)
    ]


AGREEMENT_WEIGHT, NETWORK_WEIGHT, NETWORK_CONSTANT = 0.9, 4.1, -2.7
"""Coefficients of the confidence of a word: by the share of its phones that the network finds without words, and the
mean posterior of what it finds. A logistic regression on the 201 words of ``speech-open``, of which 164 are right."""
POSTERIOR_BONUS, REACH_FRAMES = 30.0, 4
"""By so many nats a phone is more probable where its posterior is 1; around it, by less, to nothing further away."""


@dataclass(frozen=True)
class SpokenItem:
    """A word, or phones that belong to no word, as they are aligned.

    text       : of the word; empty: of no word
    variants   : pronunciations
    confidence : the probability that the word is right, 0 to 1
    """

    text: str
    variants: tuple[Pronunciation, ...]
    confidence: float


def decode_network(
    hmm: UnitHmm, aligning: LogLikelihoods, loud: NDArray[np.bool_], found: Sequence[PosteriorStretch]
) -> tuple[list[LabelledStretch], list[RecognisedWord]]:
    """Return the stretches in which a phone recogniser finds something, with their phones, and the words.

    aligning : log likelihoods of the recording for alignment
    loud     : frames that are too loud for silence [shape=(T,)]
    Raises MissingDependencyError: the language model of the words is not installed.
    """
    parts, recognised = list[LabelledStretch](), list[RecognisedWord]()
    for stretch, posteriors in found:
        items = list_spoken(posteriors)
        lexicon = Lexicon({str(number): item.variants for number, item in enumerate(items)})
        names = [str(number) for number in range(len(items))]
        aligned = _align(hmm, aligning.stretch(*stretch), loud[slice(*stretch)], names, lexicon) if items else None
        if aligned is not None:
            wordless = {len(recognised) + number for number, item in enumerate(items) if not item.text}
            parts += [
                (frames, [label._replace(word=-1) if label.word in wordless else label for label in labels])
                for frames, labels in label_words(aligned, stretch, np.ones(len(items), bool), len(recognised))
            ]
        recognised += [RecognisedWord(item.text, item.confidence) for item in items]
    return parts, recognised


def _align(
    hmm: UnitHmm, values: NDArray[np.float32], loud: NDArray[np.bool_], words: Sequence[str], lexicon: Lexicon
) -> AlignedWords | None:
    """Return words as they are aligned with the log likelihoods of a stretch; None: there is not room for them all."""
    try:
        log_likelihoods = penalise(hmm, wrap_log_likelihoods(values), loud, silent=True)
        return align_recognised_words(hmm, log_likelihoods, words, lexicon)
    except AlignmentError:
        return None


def list_spoken(posteriors: PhonePosteriors) -> list[SpokenItem]:
    """Return what is said in a stretch of English, in order; nothing where the network finds no phone."""
    if not _finds_phones(posteriors):
        return []
    items = []
    for word in decode_words(load_english(), score_stretch(posteriors)):
        found = posteriors.phones_between(word.first, word.end)
        variants = Lexicon().pronunciations(word.text) if word.text else (tuple(found),)
        if not variants[0]:
            continue
        confidence = 0.0
        if word.text:
            sure = posteriors.mean_posterior(word.first, word.end)
            agreement = max(1 - count_phone_edits(each, found) / max(len(each), len(found)) for each in variants)
            confidence = float(
                1 / (1 + np.exp(-(AGREEMENT_WEIGHT * agreement + NETWORK_WEIGHT * sure + NETWORK_CONSTANT)))
            )
        items.append(SpokenItem(word.text, variants, confidence))
    return items


def list_wordless(
    hmm: UnitHmm, loop: UnitLoop, free: LogLikelihoods, found: Sequence[PosteriorStretch]
) -> list[LabelledStretch]:
    """Return the stretches in which something is said, with their phones: in any language, and where nobody is sure.

    loop : the network of phones without words
    Every phone model becomes more probable by the posterior of its phone around each frame: where the phone recogniser
    leaves phones out, as it does in languages that it hardly knows, the models alone decide.
    """
    parts = list[LabelledStretch]()
    for stretch, posteriors in found:
        if _finds_phones(posteriors):
            frames = stretch.end - stretch.first
            row = np.minimum(np.arange(frames) // POSTERIOR_STEP, len(posteriors.values) - 1)
            posterior = np.zeros((frames, len(FORMS)), np.float32)
            for column, phone in enumerate(PHONES):
                if not is_silent(phone):
                    posterior[:, FORMS.index(normalise_word(phone))] += np.exp(posteriors.of_phones[row, column])
            values = free.stretch(*stretch) + weigh_densities(hmm, posterior, POSTERIOR_BONUS, REACH_FRAMES)
            path = loop.network.best_path(wrap_log_likelihoods(values))
            parts.append((stretch, recognise_free(loop, path, stretch.first)))
    return parts


def _finds_phones(posteriors: PhonePosteriors) -> bool:
    return any(found.token != WORD_BOUNDARY for found in posteriors.best_tokens)
