"""Words that were recognised in a stretch of a recording, aligned, and how well they fit beside free phones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.align import align_states, choose_pronunciations
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import LogLikelihoods
from lipmotion.speech.recognition.combined_phones import NOISES
from lipmotion.units import PAUSE, PHONES, SILENCE, Lexicon, find_similar_phone, is_silent
from lipmotion.units.phones import FULL_FORMS

COMPARED_FORMS = FULL_FORMS | {PAUSE: SILENCE} | dict.fromkeys(NOISES, SILENCE)
"""Phones that count as another one when phones of words and phones without words are compared."""
REACH_FRAMES = 2
"""A phone of a word may be so many frames earlier or later than in its alignment; its bonus falls linearly."""


@dataclass(frozen=True, eq=False)
class AlignedWords:
    """Words aligned with a stretch of N frames.

    words     : the words
    phones    : phones, pauses and silences, in order
    of_word   : the word of each phone, by number; -1: none [shape=(len(phones),)]
    bounds    : the first frame of each phone, from that of the stretch, and N [shape=(len(phones) + 1,)]
    densities : the density of every frame [shape=(N,)]
    """

    words: tuple[str, ...]
    phones: tuple[str, ...]
    of_word: NDArray[np.intp]
    bounds: NDArray[np.intp]
    densities: NDArray[np.intp]

    @property
    def of_frame(self) -> NDArray[np.intp]:
        """The phone of every frame, by number [shape=(N,)]."""
        return np.repeat(np.arange(len(self.phones)), np.diff(self.bounds))

    def fits(self, log_density: NDArray[np.float32], free: NDArray[np.intp]) -> tuple[NDArray[np.float64], float]:
        """Return by how much each word is less probable than freely recognised phones [shape=(W,)], and all together.

        log_density : of the stretch [shape=(N, G)]
        free        : the density of every frame on the best path of phones without words [shape=(N,)]
        A fit is the mean over frames of the difference of log densities: a log likelihood ratio in nats, seldom over 0.
        """
        frames = np.arange(len(free))
        gain = log_density[frames, self.densities].astype(float) - log_density[frames, free]
        word = self.of_word[self.of_frame]
        spoken = word >= 0
        count = np.bincount(word[spoken], minlength=len(self.words))
        total = np.bincount(word[spoken], gain[spoken], minlength=len(self.words))
        return total / np.maximum(count, 1), float(gain.mean())


def align_recognised_words(
    hmm: UnitHmm, log_likelihoods: LogLikelihoods, words: Sequence[str], lexicon: Lexicon
) -> AlignedWords:
    """Return words aligned with a stretch, as a transcript is.

    log_likelihoods : of the stretch
    Raises AlignmentError: the words do not fit into the stretch.
    """
    modelled = [unit for unit in hmm.table.units if not is_silent(unit)]
    variants = {word: lexicon.pronunciations(word) for word in set(words)}
    units = {
        word: [tuple(find_similar_phone(phone, modelled) for phone in variant) for variant in of_word]
        for word, of_word in variants.items()
    }
    spoken = choose_pronunciations(hmm, log_likelihoods, [units[word] for word in words], PAUSE)
    sequence = [unit for item in spoken for unit in item.units]
    states, path = align_states(hmm, log_likelihoods, sequence)
    phones = [(phone, item.word) for item in spoken for phone in (
        variants[words[item.word]][item.variant] if item.word >= 0 else item.units)]  # fmt: skip
    bounds = np.searchsorted(states.positions[path], np.arange(len(sequence) + 1)).astype(np.intp)
    return AlignedWords(
        tuple(words),
        tuple(phone for phone, _ in phones),
        np.array([word for _, word in phones], np.intp),
        bounds,
        states.densities[path],
    )


def phone_bonus(hmm: UnitHmm, aligned: AlignedWords, bonus: float) -> NDArray[np.float32]:
    """Return what is added to the log densities of a stretch, so that its words' phones become more probable.

    bonus : in nats, where the phone is in the alignment
    The result has the shape (N, G).
    """
    present = np.zeros((len(aligned.of_frame), len(FORMS)), np.float32)
    phone = np.array([FORMS.index(compared_form(each)) for each in aligned.phones])[aligned.of_frame]
    present[np.arange(len(phone)), phone] = 1
    return density_bonus(hmm, present, bonus, REACH_FRAMES)


def density_bonus(hmm: UnitHmm, present: NDArray[np.float32], bonus: float, reach: int) -> NDArray[np.float32]:
    """Return what is added to the log densities of a stretch, so that phones become more probable [shape=(N, G)].

    present : how far each of ``FORMS`` is said in each frame, 0 to 1 [shape=(N, F)]
    bonus   : in nats, where it is 1
    reach   : frames before and after it, over which the bonus falls linearly
    """
    share = present.copy()
    for shift in range(1, min(reach, len(present) - 1) + 1):
        least = np.float32(1 - shift / (reach + 1))
        np.maximum(share[shift:], least * present[:-shift], out=share[shift:])
        np.maximum(share[:-shift], least * present[shift:], out=share[:-shift])
    columns = [FORMS.index(compared_form(name)) for name in hmm.table.names]
    return np.float32(bonus) * share[:, columns]


def compared_form(name: str) -> str:
    """Return the general form of the phone of a density."""
    phone = name.partition(".")[0]
    return COMPARED_FORMS.get(phone, phone)


FORMS = tuple(sorted({compared_form(phone) for phone in PHONES}))
"""The phones that are compared."""
