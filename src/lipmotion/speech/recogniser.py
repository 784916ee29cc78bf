"""Phones in time out of sound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.align import align_units, choose_pronunciations
from lipmotion.hmm.decode import UnitLoop, decode_units, unit_loop
from lipmotion.hmm.log_likelihoods import LogLikelihoods, log_likelihoods_of, penalise_silence, penalise_speech
from lipmotion.hmm.loudness import loud_frames, quiet_frames
from lipmotion.hmm.model import UnitHmm
from lipmotion.speech.adaptation import Adaptation
from lipmotion.speech.combined_phones import NOISES, CombinedPhones, combine_phones, combined_log_likelihoods
from lipmotion.speech.general.front_end import general_features
from lipmotion.speech.mfcc import LOG_ENERGY, log_energy
from lipmotion.speech.speaker_similarity import speaker_similarity
from lipmotion.types import FRAME_RATE_HZ, Audio, Features, Span, Timeline, Unit
from lipmotion.units import PAUSE, SILENCE, Lexicon, is_silent, most_similar_phone

RECOGNISER_KINDS = ("auto", "own", "general")
"""Own models only, the general ones only, or both, the own ones as far as they know the voice."""
FOREIGN, FAMILIAR = -9.0, -5.0
"""Own models that explain a recording this much worse than their training data (``Voice.fit``) are not heard at all;
up to this much worse, as much as the general ones. Another speaker in the same studio costs GRID's models 4 to 6, other
voices in other rooms 7 to 15."""
FEW_GAUSSIANS = 2
"""Own models of so few Gaussians a state learned from less than two minutes: forced alignment is left to the general
ones then. With 20 clips of GRID that raises ACC of opening on the validation list from 0.767 to 0.786 (audio only),
from 0.806 to 0.841 (transcripts)."""
ENERGY_SMOOTHING_FRAMES = 11
"""The energy is averaged over so many frames before it rules silence out."""
SHORT_PAUSE_S = 0.2
"""Silence shorter than this is a pause between words."""


class Recogniser:
    """Forced alignment and recognition with a model's own phone models and those of many voices.

    own        : the phone models of a corpus
    kind       : one of ``RECOGNISER_KINDS``
    adaptation : how they hear the voice that they were adapted to, if they were
    Raises InputError: another kind.
    """

    def __init__(self, own: UnitHmm, kind: str = "auto", adaptation: Adaptation | None = None):
        if kind not in RECOGNISER_KINDS:
            raise InputError(f"unknown recogniser {kind!r}; required one of: {', '.join(RECOGNISER_KINDS)}")
        self.own = own
        self.kind = kind
        self.adaptation = adaptation

    def recognise(self, audio: Audio, features: Features) -> Timeline[Unit]:
        """Return the phones that were most probably said, in time: Viterbi with a back-off bigram.

        features : of the audio, as ``mfcc`` gives them
        Digital silence, of which all normalised features are 0, is silence.
        Raises MissingDependencyError: general models are wanted and pocketsphinx is not installed.
        Source: Hofer 2008, Eq. 5.
        """
        if not features.values.any():
            return _timeline([(SILENCE, "")], np.array([0, len(features.values)]), features.duration_s)
        _, evidence = self._evidence(audio, features)
        phones, bounds = decode_units(self._loop, evidence)
        labels = [(SILENCE if phone in NOISES else phone, "") for phone in phones]
        found = _timeline(labels, bounds, features.duration_s)
        if self.kind != "auto" or not self._knows_little:
            return found
        try:
            return self.place(audio, features, found)
        except AlignmentError:
            return found

    def align(self, audio: Audio, features: Features, words: Sequence[str], lexicon: Lexicon) -> Timeline[Unit]:
        """Return the phones of a known transcript in time.

        Which pronunciation was used, and where there were pauses, follows from the sound. A phone that the models
        have never heard borrows the sound of the nearest one that they have (``units.RELATIVES``).
        Raises AlignmentError: the transcript does not fit into the recording.
        Raises MissingDependencyError: as ``recognise``.
        """
        hmm, evidence = self._evidence(audio, features, aligning=True)
        evidence = penalise_silence(hmm, evidence, loud_frames(features.values[:, LOG_ENERGY], ENERGY_SMOOTHING_FRAMES))
        known_words = {word: lexicon.pronunciations(word) for word in set(words)}
        variants = [known_words[word] for word in words]
        known = [unit for unit in hmm.table.units if not is_silent(unit)]
        sounds = {
            word: [tuple(most_similar_phone(p, known) for p in variant) for variant in choices]
            for word, choices in known_words.items()
        }
        said = choose_pronunciations(hmm, evidence, [sounds[word] for word in words], PAUSE)
        bounds = align_units(hmm, evidence, [unit for part in said for unit in part.units])
        labels = [
            (phone, words[part.word] if part.word >= 0 else "")
            for part in said
            for phone in (variants[part.word][part.variant] if part.word >= 0 else part.units)
        ]
        return _timeline(labels, bounds, features.duration_s)

    def densities(self, audio: Audio, features: Features) -> NDArray[np.intp]:
        """Return which density was most probably heard in each frame [shape=(T,)].

        They are those of ``joint``, of the kind ``own`` those of its own models. In digital silence it is silence.
        Raises MissingDependencyError: as ``recognise``.
        """
        if not features.values.any():
            return np.full(len(features.values), self.own.table.density(SILENCE, 0), np.intp)
        _, evidence = self._evidence(audio, features)
        network = self._loop.network
        return network.emission[network.best_path(evidence)]

    def place(self, audio: Audio, features: Features, phones: Timeline[Unit]) -> Timeline[Unit]:
        """Return phones that others found where these models hear them; pauses between them may come and go.

        Raises AlignmentError: they do not fit into the recording.
        """
        names = (span.label.phone for span in phones)
        runs = [tuple(run) for silent, run in groupby(names, key=is_silent) if not silent]
        words = [" ".join(run) for run in runs]
        lexicon = Lexicon({word: (run,) for word, run in zip(words, runs, strict=True)})
        placed = self.align(audio, features, words, lexicon)
        return Timeline(tuple(replace(span, label=replace(span.label, word="")) for span in placed))

    @cached_property
    def joint(self) -> CombinedPhones:
        """The own models with all phones. Raises MissingDependencyError: pocketsphinx is not installed."""
        return combine_phones(self.own)

    @cached_property
    def _loop(self) -> UnitLoop:
        hmm = self.own if self.kind == "own" else self.joint.hmm
        return unit_loop(hmm, [unit for unit in hmm.table.units if unit != PAUSE])

    @property
    def _knows_little(self) -> bool:
        return self.own.mixtures.size[1] <= FEW_GAUSSIANS

    def _evidence(self, audio: Audio, features: Features, aligning: bool = False) -> tuple[UnitHmm, LogLikelihoods]:
        alone = self.kind == "general" or (aligning and self.kind == "auto" and self._knows_little)
        hmm, evidence = self._said(audio, features, alone)
        return hmm, penalise_speech(hmm, evidence, quiet_frames(log_energy(audio.samples)))

    def _said(self, audio: Audio, features: Features, general_alone: bool) -> tuple[UnitHmm, LogLikelihoods]:
        if self.kind == "own":
            return self.own, log_likelihoods_of(self.own, self._own_features(audio, features)[0])
        own, trust = (features.values, 0.0) if general_alone else self._own_features(audio, features)
        if trust == 0:  # they are not heard, and those of a long recording are large
            own = features.values
        general = general_features(audio) if self.adaptation is None else self.adaptation.general_features(audio)
        return self.joint.hmm, combined_log_likelihoods(self.joint, own, trust, general)

    def _own_features(self, audio: Audio, features: Features) -> tuple[NDArray[np.float32], float]:
        """Return what the own models hear, and how far they know it, from 0 to 1."""
        if self.adaptation is not None:
            return self.adaptation.own_features(audio, features), self.adaptation.trust
        voice = speaker_similarity(self.own, audio, features)
        return voice.features.values, own_model_weight(voice.fit)


@lru_cache(maxsize=4)
def cached_recogniser(own: UnitHmm, kind: str = "auto", adaptation: Adaptation | None = None) -> Recogniser:
    """Return the recogniser of some models; the last few are kept with the networks that they search."""
    return Recogniser(own, kind, adaptation)


def own_model_weight(fit: float) -> float:
    """Return how far own models that fit a recording so well (``Voice.fit``) are heard beside the general ones."""
    return min(max((fit - FOREIGN) / (FAMILIAR - FOREIGN), 0.0), 1.0)


def _timeline(labels: list[tuple[str, str]], bounds: NDArray[np.intp], duration_s: float) -> Timeline[Unit]:
    """Frame n covers (n ± ½) · 10 ms. Silence at both ends is silence however short, between words a pause."""
    labels, bounds = _one_silence(labels, bounds)
    edges = np.clip((bounds - 0.5) / FRAME_RATE_HZ, 0, duration_s)
    edges[-1] = duration_s
    spans = []
    for i, ((phone, word), start_s, end_s) in enumerate(
        zip(labels, edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    ):
        name = phone
        if is_silent(phone):
            inside = 0 < i < len(labels) - 1
            name = PAUSE if inside and end_s - start_s < SHORT_PAUSE_S else SILENCE
        spans.append(Span(start_s, end_s, Unit(name, word=word)))
    return Timeline(tuple(spans))


def _one_silence(
    labels: list[tuple[str, str]], bounds: NDArray[np.intp]
) -> tuple[list[tuple[str, str]], NDArray[np.intp]]:
    """Join silences that follow one another: noise beside silence is silence."""
    first = [
        i for i, (phone, _) in enumerate(labels) if i == 0 or not (is_silent(phone) and is_silent(labels[i - 1][0]))
    ]
    return [labels[i] for i in first], np.append(bounds[first], bounds[-1])
