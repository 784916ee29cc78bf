"""The search for English words in a recording: which are recognised, and which of them are used."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.decode import UnitLoop, decode_path
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import LogLikelihoods, penalise_silence, wrap_log_likelihoods
from lipmotion.speech.features.analysed_audio import AnalysedAudio
from lipmotion.speech.recognition.combined_phones import NOISES
from lipmotion.speech.recognition.recognised_speech import (
    LabelledFrames,
    LabelledStretch,
    RecognisedWord,
    labels_of_words,
    spliced,
)
from lipmotion.speech.recognition.word_decoder import FoundWord, words_in
from lipmotion.speech.recognition.word_fit import AlignedWords, align_recognised_words, phone_bonus
from lipmotion.speech.sound.voice_activity import Stretch, stretch_samples, stretches_of_sound
from lipmotion.types import ParallelMap
from lipmotion.units import SILENCE, Lexicon

WORD_FIT, STRETCH_FIT = -2.0, -1.5
"""Words are believed from the first fit on, all words of a stretch from the second one on (``AlignedWords.fits``)."""
WORD_BONUS = 2.0
"""Where words are not believed, their phones are still more probable than others, by so many nats a frame."""
FIT_WEIGHT, POSTERIOR_WEIGHT, CONSTANT = 0.62, 3.4, -1.9
LEAST_FIT, MOST_FIT = -4.0, 1.0
"""Coefficients of the confidence; fits count within these limits."""
SHORT_FRAMES = 3000
"""The words of so little sound are recognised in this process: to start another one would take as long."""
DICTIONARY = Lexicon()
"""Words that were recognised are in the dictionary."""


class WordsInStretches(NamedTuple):
    """Stretches of sound, and the words that are found in each of them, as soon as they are known."""

    stretches: Sequence[Stretch]
    words: Iterable[Sequence[FoundWord]]


def begun_decoding(audio: AnalysedAudio, each: ParallelMap = map) -> WordsInStretches:
    """Return the words in all stretches of sound of a recording; where ``each`` starts processes, they begin now.

    each : applies a function to many items, perhaps in several processes
    """
    stretches = stretches_of_sound(audio.log_energy)
    each = each if sum(stretch.end - stretch.first for stretch in stretches) > SHORT_FRAMES else map
    return WordsInStretches(stretches, each(words_in, (stretch_samples(audio, stretch) for stretch in stretches)))


@dataclass(frozen=True, eq=False)
class WordSearch:
    """The search for words in one recording of T frames, beside the phones that are recognised without words.

    hmm       : the phone models
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

        spoken : of ``begun_decoding``
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
        likelihoods = penalise_silence(self.hmm, wrap_log_likelihoods(values), self.loud[slice(*stretch)])
        try:
            aligned = align_recognised_words(self.hmm, likelihoods, words, DICTIONARY)
        except AlignmentError:  # there is not room for them all
            return [], [LEAST_FIT] * len(words)
        fits, fit = aligned.fits(values, self.path[slice(*stretch)])
        believed = np.full(len(words), self.believing or fit > STRETCH_FIT) | (fits > WORD_FIT)
        decided = list(labels_of_words(aligned, stretch, believed, first_word))
        if not believed.all():
            decided = [(stretch, spliced(self._favouring(stretch, aligned), decided, stretch.end))]
        return decided, fits.tolist()

    def _favouring(self, stretch: Stretch, aligned: AlignedWords) -> list[LabelledFrames]:
        """Return the phones of a stretch that are recognised if those of words in it are more probable than others."""
        values = self.free.stretch(*stretch) + phone_bonus(self.hmm, aligned, WORD_BONUS)
        return free_labels(self.loop, self.loop.network.best_path(wrap_log_likelihoods(values)), stretch.first)


def score_words(fit: float, posterior: float) -> float:
    """Return the probability that a word is right, 0 to 1: by logistic regression (docs/decisions/recognition.md).

    fit       : of the word (``AlignedWords.fits``), in nats
    posterior : among the words of the search
    """
    score = FIT_WEIGHT * min(max(fit, LEAST_FIT), MOST_FIT) + POSTERIOR_WEIGHT * posterior + CONSTANT
    return float(1 / (1 + np.exp(-score)))


def free_labels(loop: UnitLoop, path: NDArray[np.intp], first: int = 0) -> list[LabelledFrames]:
    """Return the phones of a path through a loop [shape=(T,)] whose first frame is ``first``; noises are silence."""
    phones, starts = decode_path(loop, path)
    return [
        LabelledFrames(first + int(start), SILENCE if phone in NOISES else phone)
        for phone, start in zip(phones, starts[:-1], strict=True)
    ]
