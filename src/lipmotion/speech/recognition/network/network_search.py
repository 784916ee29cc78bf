"""Speech in the posteriors of a phone recogniser: English words, or phones alone, aligned by phone models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError
from lipmotion.hmm.log_likelihoods import LogLikelihoods, log_likelihoods_from, penalise_silence
from lipmotion.hmm.model import UnitHmm
from lipmotion.speech.recognition.network.beam_search import decoded_words, scored
from lipmotion.speech.recognition.network.posteriors import (
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
from lipmotion.speech.recognition.word_fit import align_recognised_words
from lipmotion.speech.sound.voice_activity import Stretch
from lipmotion.units import Lexicon, Pronunciation
from lipmotion.units.ipa_phones import token_phones
from lipmotion.units.phones import phone_edits

AGREEMENT_WEIGHT, POSTERIOR_WEIGHT, CONSTANT = 0.9, 4.1, -2.7
"""Coefficients of the confidence of a word: by the share of its phones that the network finds without words, and the
mean posterior of what it finds. A logistic regression on the 201 words of ``speech-open``, of which 164 are right."""


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
    english  : whether words are searched; else phones alone
    """

    hmm: UnitHmm
    aligning: LogLikelihoods
    loud: NDArray[np.bool_]
    english: bool = True

    def labels(self, found: Sequence[PosteriorStretch]) -> tuple[list[LabelledStretch], list[RecognisedWord]]:
        """Return the stretches in which something is said, with their phones, and the words.

        Raises MissingDependencyError: words are searched, and their language model is not installed.
        """
        parts, recognised = list[LabelledStretch](), list[RecognisedWord]()
        for stretch, posteriors in found:
            items = spoken_items(posteriors, english=self.english)
            if items:
                parts += self._aligned(stretch, items, len(recognised))
                recognised += [RecognisedWord(item.text, item.confidence) for item in items]
        return parts, recognised

    def _aligned(self, stretch: Stretch, items: list[SpokenItem], first_word: int) -> list[LabelledStretch]:
        """Return the frames of a stretch with its phones; words are numbered from ``first_word`` on."""
        values = log_likelihoods_from(self.aligning.stretch(*stretch))
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


def spoken_items(posteriors: PhonePosteriors, *, english: bool) -> list[SpokenItem]:
    """Return what is said in a stretch, in order; nothing where the network finds no phone."""
    if all(found.token == WORD_BOUNDARY for found in posteriors.best_tokens):
        return []
    if not english:
        return _phones_alone(posteriors)
    items = []
    for word in decoded_words(english_words(), scored(posteriors)):
        found = posteriors.phones_between(word.first, word.end)
        variants = Lexicon().pronunciations(word.text) if word.text else (tuple(found),)
        if variants[0]:
            confidence = _confidence(posteriors, word.first, word.end, found, variants) if word.text else 0.0
            items.append(SpokenItem(word.text, variants, confidence))
    return items or _phones_alone(posteriors)


def _phones_alone(posteriors: PhonePosteriors) -> list[SpokenItem]:
    """Return the phones of the best path, word by word as the network divides them."""
    items, tokens = list[SpokenItem](), list[str]()
    for token in [*(found.token for found in posteriors.best_tokens), WORD_BOUNDARY]:
        if token != WORD_BOUNDARY:
            tokens.append(token)
            continue
        phones = tuple(phone for phone, _ in token_phones(tokens))
        tokens = []
        if phones:
            items.append(SpokenItem("", (phones,), 0.0))
    return items


def _confidence(
    posteriors: PhonePosteriors, first: int, end: int, found: list[str], variants: tuple[Pronunciation, ...]
) -> float:
    """Return the probability that a word is right, 0 to 1."""
    sure = posteriors.mean_posterior(first, end)
    agreement = max(1 - phone_edits(variant, found) / max(len(variant), len(found)) for variant in variants)
    score = AGREEMENT_WEIGHT * agreement + POSTERIOR_WEIGHT * sure + CONSTANT
    return float(1 / (1 + np.exp(-score)))
