"""Speech in the posteriors of a phone recogniser: English words, or phones alone, aligned by phone models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.decode import UnitLoop
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import LogLikelihoods, penalise_silence, wrap_log_likelihoods
from lipmotion.speech.recognition.network.beam_search import decoded_words, scored
from lipmotion.speech.recognition.network.posteriors import (
    POSTERIOR_STEP,
    WORD_BOUNDARY,
    PhonePosteriors,
    PosteriorStretch,
)
from lipmotion.speech.recognition.network.word_tree import english_words
from lipmotion.speech.recognition.recognised_speech import (
    LabelledStretch,
    RecognisedWord,
    labels_of_words,
)
from lipmotion.speech.recognition.word_fit import FORMS, align_recognised_words, compared_form, density_bonus
from lipmotion.speech.recognition.word_search import free_labels
from lipmotion.speech.sound.voice_activity import Stretch
from lipmotion.units import PHONES, Lexicon, Pronunciation, is_silent
from lipmotion.units.phones import count_phone_edits

AGREEMENT_WEIGHT, POSTERIOR_WEIGHT, CONSTANT = 0.9, 4.1, -2.7
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


@dataclass(frozen=True, eq=False)
class NetworkSearch:
    """The alignment of what a phone recogniser finds in one recording.

    hmm      : the phone models
    aligning : log likelihoods of the recording for alignment
    loud     : frames that are too loud for silence [shape=(T,)]
    """

    hmm: UnitHmm
    aligning: LogLikelihoods
    loud: NDArray[np.bool_]

    def labels(self, found: Sequence[PosteriorStretch]) -> tuple[list[LabelledStretch], list[RecognisedWord]]:
        """Return the stretches in which something is said, with their phones, and the words.

        Raises MissingDependencyError: the language model of the words is not installed.
        """
        parts, recognised = list[LabelledStretch](), list[RecognisedWord]()
        for stretch, posteriors in found:
            items = spoken_items(posteriors)
            if items:
                parts += self._aligned(stretch, items, len(recognised))
                recognised += [RecognisedWord(item.text, item.confidence) for item in items]
        return parts, recognised

    def _aligned(self, stretch: Stretch, items: list[SpokenItem], first_word: int) -> list[LabelledStretch]:
        """Return the frames of a stretch with its phones; words are numbered from ``first_word`` on."""
        values = wrap_log_likelihoods(self.aligning.stretch(*stretch))
        likelihoods = penalise_silence(self.hmm, values, self.loud[slice(*stretch)])
        names = [str(number) for number in range(len(items))]
        lexicon = Lexicon({name: item.variants for name, item in zip(names, items, strict=True)})
        try:
            aligned = align_recognised_words(self.hmm, likelihoods, names, lexicon)
        except AlignmentError:  # there is not room for them all
            return []
        parts = labels_of_words(aligned, stretch, np.ones(len(items), bool), first_word)
        wordless = {first_word + number for number, item in enumerate(items) if not item.text}
        return [
            (frames, [label._replace(word=-1) if label.word in wordless else label for label in labels])
            for frames, labels in parts
        ]


def spoken_items(posteriors: PhonePosteriors) -> list[SpokenItem]:
    """Return what is said in a stretch of English, in order; nothing where the network finds no phone."""
    if not _finds_phones(posteriors):
        return []
    items = []
    for word in decoded_words(english_words(), scored(posteriors)):
        found = posteriors.phones_between(word.first, word.end)
        variants = Lexicon().pronunciations(word.text) if word.text else (tuple(found),)
        if variants[0]:
            confidence = _confidence(posteriors, word.first, word.end, found, variants) if word.text else 0.0
            items.append(SpokenItem(word.text, variants, confidence))
    return items


def phones_without_words(
    hmm: UnitHmm, loop: UnitLoop, free: LogLikelihoods, found: Sequence[PosteriorStretch]
) -> list[LabelledStretch]:
    """Return the stretches in which something is said, with their phones: in any language, and where nobody is sure.

    loop : the network of phones without words
    free : log likelihoods of the recording
    Every phone model becomes more probable by the posterior of its phone around each frame: where the phone recogniser
    leaves phones out, as it does in languages that it hardly knows, the models alone decide.
    """
    parts = list[LabelledStretch]()
    for stretch, posteriors in found:
        if _finds_phones(posteriors):
            values = free.stretch(*stretch) + _posterior_bonus(hmm, posteriors, stretch.end - stretch.first)
            path = loop.network.best_path(wrap_log_likelihoods(values))
            parts.append((stretch, free_labels(loop, path, stretch.first)))
    return parts


def _posterior_bonus(hmm: UnitHmm, posteriors: PhonePosteriors, frames: int) -> NDArray[np.float32]:
    """Return what is added to the log densities of a stretch [shape=(frames, G)]."""
    row = np.minimum(np.arange(frames) // POSTERIOR_STEP, len(posteriors.values) - 1)
    posterior = np.zeros((frames, len(FORMS)), np.float32)
    for column, phone in enumerate(PHONES):
        if not is_silent(phone):
            posterior[:, FORMS.index(compared_form(phone))] += np.exp(posteriors.of_phones[row, column])
    return density_bonus(hmm, posterior, POSTERIOR_BONUS, REACH_FRAMES)


def _finds_phones(posteriors: PhonePosteriors) -> bool:
    return any(found.token != WORD_BOUNDARY for found in posteriors.best_tokens)


def _confidence(
    posteriors: PhonePosteriors, first: int, end: int, found: list[str], variants: tuple[Pronunciation, ...]
) -> float:
    """Return the probability that a word is right, 0 to 1."""
    sure = posteriors.mean_posterior(first, end)
    agreement = max(1 - count_phone_edits(variant, found) / max(len(variant), len(found)) for variant in variants)
    score = AGREEMENT_WEIGHT * agreement + POSTERIOR_WEIGHT * sure + CONSTANT
    return float(1 / (1 + np.exp(-score)))
