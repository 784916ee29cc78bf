"""The search for English words in a recording: which are recognised, and which of them are used."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import LogLikelihoods, UnitLoop, decode_path, wrap_log_likelihoods
from lipmotion.speech.recognition.general import NOISES
from lipmotion.speech.recognition.network.beam_search import decode_words, load_english, score_stretch
from lipmotion.speech.recognition.network.posteriors import POSTERIOR_STEP, PhonePosteriors, PosteriorStretch
from lipmotion.speech.recognition.recognised_speech import (
    FORMS,
    LabelledFrames,
    LabelledStretch,
    RecognisedWord,
    align_recognised_words,
    find_form,
    label_words,
    splice,
    weigh_densities,
)
from lipmotion.speech.sound.analysed_audio import AnalysedAudio
from lipmotion.speech.sound.voice_activity import Stretch, find_sound, read_stretch
from lipmotion.types import SPEECH_RATE_HZ, ParallelMap
from lipmotion.units import PHONES, SILENCE, Lexicon, Pronunciation, is_silent
from lipmotion.units.lexicon import find_english_data
from lipmotion.units.phones import count_phone_edits


class FoundWord(NamedTuple):
    """A word in lower case, and its posterior probability among all words of the search, 0 to 1."""

    text: str
    posterior: float


VARIANT = re.compile(r"\(\d+\)$")  # the number of a pronunciation behind a word
OPTIONS = {"fwdflat": False, "maxhmmpf": 10_000}
"""One pass over the tree of all words finds more phones, and faster, than with a second one over the words that it
found (docs/decisions/recognition.md)."""
_LOCK = threading.Lock()  # a decoder works on one recording at a time


def spot_words(samples: bytes) -> tuple[FoundWord, ...]:
    """Return the words that are recognised in a stretch of sound; none if there are none.

    samples : 16-bit integers at 16 kHz
    The words are those of the best path of the search. Their posteriors are those of the best path through its lattice,
    0 where that has another word: it finds fewer words, but knows how many others were possible.
    Raises MissingDependencyError: pocketsphinx is not installed, or without its language model.
    """
    decoder = _load_decoder()
    with _LOCK:
        decoder.reinit_feat()  # else its estimate of the noise depends on what it decoded before
        decoder.start_utt()
        if samples:
            decoder.process_raw(samples, no_search=False, full_utt=True)
        best = _list_segments(decoder)
        decoder.end_utt()
        lattice = _list_segments(decoder)
    words = []
    for word, start, end, _ in best:
        same = (each[3] for each in lattice if each[0] == word and max(start, each[1]) <= min(end, each[2]))
        words.append(FoundWord(word, max(same, default=0.0)))
    return tuple(words)


def _list_segments(decoder: Any) -> list[tuple[str, int, int, float]]:
    """Return the words of the decoder's present best path, their first and last frames, and their posteriors."""
    entries = decoder.seg() if decoder.hyp() is not None else ()
    return [
        (VARIANT.sub("", entry.word), entry.start_frame, entry.end_frame, min(max(entry.prob, 0.0), 1.0))
        for entry in entries
        if entry.word[:1] not in ("<", "[", "+")  # silence and noise: <sil>, [NOISE], ++UH++
    ]


@cache
def _load_decoder() -> Any:
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
        message = f"words are recognised by pocketsphinx and its language model ({error}): pip install pocketsphinx"
        raise MissingDependencyError(message) from error


WORD_FIT, STRETCH_FIT = -2.0, -1.5
"""Words are believed from the first fit on, all words of a stretch from the second one on (``AlignedWords.fits``)."""
WORD_BONUS, WORD_REACH_FRAMES = 2.0, 2
"""Where words are not believed, their phones are still more probable than others, by so many nats a frame, and so many
frames earlier or later than in their alignment, linearly less."""
FIT_WEIGHT, POSTERIOR_WEIGHT, CONSTANT = 0.62, 3.4, -1.9
"""Coefficients of the logistic regression that says how sure a word is (docs/decisions/recognition.md)."""
MIN_FIT, MAX_FIT = -4.0, 1.0  # fits count within these limits
SHORT_FRAMES = 3000
"""The words of so little sound are recognised in this process: to start another one would take as long."""
DICTIONARY = Lexicon()  # words that were recognised are in the dictionary


def scan_words(audio: AnalysedAudio, each: ParallelMap = map) -> Iterable[tuple[Stretch, Sequence[FoundWord]]]:
    """Return all stretches of sound of a recording, with the words in them as soon as they are known.

    Where ``each`` starts processes, they begin now. Raises MissingDependencyError: as ``spot_words``.
    """
    stretches = find_sound(audio.log_energy)
    each = each if sum(stretch.end - stretch.first for stretch in stretches) > SHORT_FRAMES else map
    return zip(stretches, each(spot_words, (read_stretch(audio, stretch) for stretch in stretches)), strict=True)


def match_words(
    hmm: UnitHmm,
    loop: UnitLoop,
    free: LogLikelihoods,
    aligning: LogLikelihoods,
    path: NDArray[np.intp],
    loud: NDArray[np.bool_],
    spoken: Iterable[tuple[Stretch, Sequence[FoundWord]]],
) -> tuple[list[LabelledStretch], list[RecognisedWord]]:
    """Return the stretches of a recording of T frames whose phones words decide, with these, and all words found.

    loop, free : the network of phones without words, and the log likelihoods for it
    aligning   : log likelihoods for the alignment of words
    path       : the density of every frame on the best path of phones without words [shape=(T,)]
    loud       : frames that are too loud for silence [shape=(T,)]
    spoken     : of ``scan_words``, whose errors it raises
    """
    parts, recognised = list[LabelledStretch](), list[RecognisedWord]()
    for stretch, words in spoken:
        if not words:
            continue
        fits, texts = np.full(len(words), MIN_FIT), [word.text for word in words]
        values = aligning.stretch(*stretch)
        aligned = align_recognised_words(hmm, values, loud[slice(*stretch)], texts, DICTIONARY)
        if aligned is not None:
            fits, fit = aligned.fits(values, path[slice(*stretch)])
            believed = np.full(len(words), fit > STRETCH_FIT) | (fits > WORD_FIT)
            decided = list(label_words(aligned, stretch, believed, len(recognised)))
            if not believed.all():
                # phones as they are recognised if those of words in it are more probable than others
                forms = np.array([FORMS.index(find_form(phone)) for phone in aligned.phones])
                present = np.eye(len(FORMS), dtype=np.float32)[forms[aligned.of_frame]]
                bonus = weigh_densities(hmm, present, WORD_BONUS, WORD_REACH_FRAMES)
                drawn = loop.network.best_path(wrap_log_likelihoods(free.stretch(*stretch) + bonus))
                decided = [(stretch, splice(list_phones(loop, drawn, stretch.first), decided, stretch.end))]
            parts += decided
        for word, fit in zip(words, np.clip(fits, MIN_FIT, MAX_FIT).tolist(), strict=True):
            confidence = _logistic(FIT_WEIGHT * fit + POSTERIOR_WEIGHT * word.posterior + CONSTANT)
            recognised.append(RecognisedWord(word.text, confidence))
    return parts, recognised


def _logistic(score: float) -> float:
    return float(1 / (1 + np.exp(-score)))


def list_phones(loop: UnitLoop, path: NDArray[np.intp], first: int = 0) -> list[LabelledFrames]:
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


def decode_network(
    hmm: UnitHmm, aligning: LogLikelihoods, loud: NDArray[np.bool_], stretches: Sequence[PosteriorStretch]
) -> tuple[list[LabelledStretch], list[RecognisedWord]]:
    """Return the stretches in which a phone recogniser finds something, with their phones, and the words.

    aligning : log likelihoods of the recording for alignment
    loud     : frames that are too loud for silence [shape=(T,)]
    Raises MissingDependencyError: the language model of the words is not installed.
    """
    parts, recognised = list[LabelledStretch](), list[RecognisedWord]()
    for stretch, posteriors in stretches:
        if not (items := list_spoken(posteriors)):
            continue
        lexicon = Lexicon({str(number): variants for number, (_, variants) in enumerate(items)})
        values = aligning.stretch(*stretch)
        aligned = align_recognised_words(hmm, values, loud[slice(*stretch)], [*lexicon.user], lexicon)
        if aligned is not None:
            wordless = {len(recognised) + number for number, (word, _) in enumerate(items) if not word.text}
            parts += [
                (frames, [label._replace(word=-1) if label.word in wordless else label for label in labels])
                for frames, labels in label_words(aligned, stretch, np.ones(len(items), bool), len(recognised))
            ]
        recognised += [word for word, _ in items]
    return parts, recognised


def list_spoken(posteriors: PhonePosteriors) -> list[tuple[RecognisedWord, tuple[Pronunciation, ...]]]:
    """Return the words of a stretch of English with their pronunciations; phones of no word have an empty text."""
    if not posteriors.has_phones:
        return []
    items = []
    for word in decode_words(load_english(), score_stretch(posteriors)):
        heard = posteriors.phones_between(word.first, word.end)
        variants = DICTIONARY.pronunciations(word.text) if word.text else (tuple(heard),)
        if not variants[0]:
            continue
        confidence = 0.0
        if word.text:
            agreement = max(1 - count_phone_edits(each, heard) / max(len(each), len(heard)) for each in variants)
            score = AGREEMENT_WEIGHT * agreement + NETWORK_WEIGHT * posteriors.mean_posterior(word.first, word.end)
            confidence = _logistic(score + NETWORK_CONSTANT)
        items.append((RecognisedWord(word.text, confidence), variants))
    return items


def list_wordless(
    hmm: UnitHmm, loop: UnitLoop, free: LogLikelihoods, stretches: Sequence[PosteriorStretch]
) -> list[LabelledStretch]:
    """Return the stretches in which something is said, with their phones: in any language, and where nobody is sure.

    loop : the network of phones without words
    Every phone model becomes more probable by the posterior of its phone around each frame: where the phone recogniser
    leaves phones out, as it does in languages that it hardly knows, the models alone decide.
    """
    parts = list[LabelledStretch]()
    for stretch, posteriors in stretches:
        if posteriors.has_phones:
            frames = stretch.end - stretch.first
            row = np.minimum(np.arange(frames) // POSTERIOR_STEP, len(posteriors.values) - 1)
            posterior = np.zeros((frames, len(FORMS)), np.float32)
            for column, phone in enumerate(PHONES):
                if not is_silent(phone):
                    posterior[:, FORMS.index(find_form(phone))] += np.exp(posteriors.of_phones[row, column])
            values = free.stretch(*stretch) + weigh_densities(hmm, posterior, POSTERIOR_BONUS, REACH_FRAMES)
            path = loop.network.best_path(wrap_log_likelihoods(values))
            parts.append((stretch, list_phones(loop, path, stretch.first)))
    return parts
