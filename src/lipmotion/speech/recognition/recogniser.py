"""Phone recognition and forced alignment of recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.align import PlacedWord, SpokenWord, align_units, place_words, spread_windows
from lipmotion.hmm.loudness import find_loud_frames, find_quiet_frames
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.network import LogLikelihoods, UnitLoop, build_unit_loop, compute_log_likelihoods, penalise
from lipmotion.kernels.paths import Windows
from lipmotion.speech.recognition.adaptation import Adaptation
from lipmotion.speech.recognition.general import CombinedPhones, combine_likelihoods, combine_phones
from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser, find_stretches, mean_posterior
from lipmotion.speech.recognition.recognised_speech import (
    WORD_POSTERIORS,
    LabelledFrames,
    RecognisedWord,
    Recognition,
    build_recognition,
    join_recognition,
    splice,
    time_phones,
)
from lipmotion.speech.recognition.word_search import decode_network, list_phones, list_wordless, match_words, scan_words
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.sound.speaker_similarity import OWN_SCORE, STRANGER_SCORE, SpeakerSimilarity, measure_similarity
from lipmotion.types import FRAME_RATE_HZ, Audio, ParallelMap, Timeline, Unit
from lipmotion.units import PAUSE, SILENCE, Lexicon, find_similar_phone, is_silent

if TYPE_CHECKING:
    from lipmotion.speech.recognition.anchors import Anchors

RECOGNISER_KINDS = ("auto", "fast", "own", "general")
"""Phones are recognised by: ``own``: the model's own phone models alone; ``general``: those of many voices alone;
``fast``: both, the own ones weighted by how similar the speaker is to those of their training data. ``auto``: by a
phone recogniser, where one is installed and sure; else as ``fast``, and words where they fit: English words that
pocketsphinx recognises are aligned."""
SMALL_PERPLEXITY = 9.0
"""A voice with a speaker similarity over ``OWN_SCORE`` is that of the own models; if the perplexity of their bigram is
less than this, their corpus has few words, which no language model of English expects. Then the phones alone decide.
The perplexity is 5.3 for GRID's 51 words, 18.6 for English."""
FULL_WEIGHT_SCORE = -5.0
"""Own models have the weight of the general ones from this similarity on, and none down from ``STRANGER_SCORE``."""
FEW_GAUSSIANS = 2
"""Own models of so few Gaussians a state were trained on less than two minutes: forced alignment uses the general ones
alone then. With 20 clips of GRID that raises ACC of opening on the validation list from 0.767 to 0.786 (audio only),
from 0.806 to 0.841 (transcripts)."""


@dataclass(frozen=True, eq=False)
class Recogniser:
    """Forced alignment and recognition with a model's own phone models and those of many voices.

    Raises InputError: another kind than ``RECOGNISER_KINDS``.
    """

    own: UnitHmm  # the phone models of a corpus
    kind: str = "auto"  # one of ``RECOGNISER_KINDS``
    adaptation: Adaptation | None = None  # to one speaker; with one, the speaker similarity is not computed

    def __post_init__(self) -> None:
        if self.kind not in RECOGNISER_KINDS:
            raise InputError(f"unknown recogniser {self.kind!r}; required one of: {', '.join(RECOGNISER_KINDS)}")

    def recognise(self, audio: Audio, each: ParallelMap = map, *, english: bool = True) -> Recognition:
        """Return the most probable phones of a recording in time, with the words that decided them.

        audio   : an ``AnalysedAudio`` shares its features with what else is computed of it; where all of them are 0, as
                  in digital silence, there is silence
        english : whether English words are searched; in other languages, phones alone
        Words are recognised in every stretch of sound and aligned by our models: by a phone recogniser where it is sure
        (``speech.recognition.network``), else by pocketsphinx. Then ``auto`` compares their likelihood with that of the
        best path of phones without words: words that fit decide their phones; of the other words, the phones only
        become more probable (``speech.recognition.word_search``).
        Raises MissingDependencyError: general models or words are wanted and pocketsphinx is not installed.
        Source: Hofer 2008, Eq. 5 (Viterbi with a back-off bigram).
        """
        audio = analysed(audio)
        if not any(passage.audio.mfcc().values.any() for passage in audio.passages):
            return build_recognition([LabelledFrames(0, SILENCE)], (), audio, None)
        if not audio.is_passage:
            if uses_network(self.kind):
                find_stretches(audio, each)  # of all passages at once: several processes work on them
            recognitions = [self.recognise(passage.audio, each, english=english) for passage in audio.passages]
            return join_recognition(list(zip(audio.passages, recognitions, strict=True)), audio.duration_s)
        is_judged = self.adaptation is None and self.kind != "general"  # else nothing depends on it
        similarity = measure_similarity(self.own, audio) if is_judged else None
        is_own = similarity is not None and similarity.score > OWN_SCORE
        known = self.kind == "auto" and is_own and self.own.bigram.perplexity < SMALL_PERPLEXITY
        if uses_network(self.kind) and not known:
            stretches = find_stretches(audio, each)
            if mean_posterior(stretches) >= WORD_POSTERIORS[0] or not english:
                return self._recognise_by_network(audio, similarity, english=english)
        spoken = scan_words(audio, each) if self.kind == "auto" and not known else None
        hmm, log_likelihoods = self._evaluate(audio, similarity)
        path = self._loop.network.best_path(log_likelihoods)
        labels, recognised = self._label_freely(audio, path), list[RecognisedWord]()
        if spoken is not None:
            aligning = self._evaluate(audio, aligning=True)[1] if self._has_few_gaussians else log_likelihoods
            loud, free = find_loud_frames(audio.log_energy), self._loop.network.emission[path]
            parts, recognised = match_words(hmm, self._loop, log_likelihoods, aligning, free, loud, spoken)
            labels = splice(labels, parts, len(path))
        return build_recognition(labels, recognised, audio, similarity and similarity.score)

    def _recognise_by_network(
        self, audio: AnalysedAudio, similarity: SpeakerSimilarity | None, *, english: bool
    ) -> Recognition:
        """Return what a phone recogniser finds in a recording: words, or phones that our models find as well."""
        stretches, loud = find_stretches(audio), find_loud_frames(audio.log_energy)
        hmm, log_likelihoods = self._evaluate(audio, similarity, aligning=english)
        if english:
            parts, recognised = decode_network(hmm, log_likelihoods, loud, stretches)
        else:
            parts, recognised = list_wordless(hmm, self._loop, log_likelihoods, stretches), []
        labels = splice([LabelledFrames(0, SILENCE)], parts, len(loud))
        recognition = build_recognition(labels, recognised, audio, similarity and similarity.score)
        return replace(recognition, posterior=mean_posterior(stretches))

    def _label_freely(self, audio: AnalysedAudio, path: NDArray[np.intp]) -> list[LabelledFrames]:
        """Return the phones of a recording as they are recognised without words, of their best path."""
        labels = list_phones(self._loop, path)
        if self.kind not in ("auto", "fast") or not self._has_few_gaussians:
            return labels
        named, bounds = [(label.phone, "") for label in labels], [label.first for label in labels]
        phones = time_phones(named, np.array([*bounds, len(path)]), audio.duration_s)
        try:
            aligned = self.align_phones(audio, phones)
        except AlignmentError:
            return labels
        frames = [round(span.start_s * FRAME_RATE_HZ + 0.5) if span.start_s > 0 else 0 for span in aligned]
        return [LabelledFrames(frame, span.label.phone) for frame, span in zip(frames, aligned, strict=True)]

    def align(
        self, audio: Audio, words: Sequence[str], lexicon: Lexicon, anchors: Anchors | None = None
    ) -> Timeline[Unit]:
        """Return the phones of a known transcript in time: forced alignment.

        words   : of the transcript, in lower case, and written forms (``1995``): the words that are said replace these
        anchors : times of the words, within which they are aligned (``recognition.anchors``); None: anywhere
        The reading and the pronunciation of each word, and the pauses, are those with the most probable path. A phone
        without a model borrows that of the most similar phone with one (``units.SIMILAR_PHONES``).
        Raises AlignmentError: the transcript does not fit into the recording. MissingDependencyError: ``recognise``.
        """
        audio = analysed(audio)
        hmm, log_likelihoods = self._evaluate(audio, aligning=True)
        log_likelihoods = penalise(hmm, log_likelihoods, find_loud_frames(audio.log_energy), silent=True)
        forms_of = {word: lexicon.spoken_forms(word) for word in set(words)}
        modelled = {PAUSE, *(unit for unit in hmm.table.units if not is_silent(unit))}
        units_of = {
            word: [tuple(find_similar_phone(phone, modelled) for phone, _ in form) for form in forms]
            for word, forms in forms_of.items()
        }
        spoken, bounds = _align_words(hmm, log_likelihoods, [units_of[word] for word in words], anchors)
        labels: list[tuple[str, str]] = []
        for item in spoken:
            count_before = len(labels)
            form = forms_of[words[item.word]][item.variant] if item.word >= 0 else [(unit, "") for unit in item.units]
            for phone, word in form:
                if phone != PAUSE or item.units[len(labels) - count_before] == PAUSE:  # else it was not made
                    labels.append((phone, word))
        return time_phones(labels, bounds, audio.duration_s)

    def find_path_densities(self, audio: Audio) -> NDArray[np.intp]:
        """Return the density of each frame's state on the most probable path [shape=(T,)].

        They are numbered as in ``combined``, with the kind ``own`` as in the own models; of digital silence as silence.
        Raises MissingDependencyError: as ``recognise``.
        """
        audio = analysed(audio)
        if not audio.mfcc().values.any():
            return np.full(audio.frames, self.own.table.density(SILENCE, 0), np.intp)
        _, log_likelihoods = self._evaluate(audio)
        network = self._loop.network
        return network.emission[network.best_path(log_likelihoods)]

    def align_phones(self, audio: Audio, phones: Timeline[Unit]) -> Timeline[Unit]:
        """Return known phones in time: forced alignment, with optional pauses where ``phones`` has silence.

        phones          : in order; their times are not used
        Raises AlignmentError: they do not fit into the recording.
        """
        names = (span.label.phone for span in phones)
        runs = [tuple(run) for silent, run in groupby(names, key=is_silent) if not silent]
        words = [" ".join(run) for run in runs]
        lexicon = Lexicon({word: (run,) for word, run in zip(words, runs, strict=True)})
        aligned = self.align(audio, words, lexicon)
        return Timeline(tuple(replace(span, label=replace(span.label, word="")) for span in aligned))

    @cached_property
    def combined(self) -> CombinedPhones:
        """The own models extended to all phones. Raises MissingDependencyError: pocketsphinx is not installed."""
        return combine_phones(self.own)

    @cached_property
    def _loop(self) -> UnitLoop:
        hmm = self.own if self.kind == "own" else self.combined.hmm
        return build_unit_loop(hmm, [unit for unit in hmm.table.units if unit != PAUSE])

    @property
    def _has_few_gaussians(self) -> bool:
        return self.own.mixtures.size[1] <= FEW_GAUSSIANS

    def _evaluate(
        self, audio: AnalysedAudio, similarity: SpeakerSimilarity | None = None, aligning: bool = False
    ) -> tuple[UnitHmm, LogLikelihoods]:
        """Return the models that are used, and the log likelihoods of a recording under them."""
        own_alone = self.kind == "own"
        general_alone = self.kind == "general" or (aligning and self._has_few_gaussians and not own_alone)
        warp, weight = 1.0, 0.0  # of the own models
        if self.adaptation is not None and not general_alone:
            weight = self.adaptation.own_weight
        elif not general_alone:
            similarity = similarity or measure_similarity(self.own, audio)
            warp, weight = similarity.warp, weigh_own_model(similarity.score)
        if weight <= 0 and not own_alone:  # not evaluated: any features will do; those of an hour are large
            cepstra = audio.mfcc().values
        else:
            cepstra = audio.mfcc(warp).values if self.adaptation is None else self.adaptation.own_features(audio)
        if own_alone:
            hmm, log_likelihoods = self.own, compute_log_likelihoods(self.own, cepstra)
        else:
            general = audio.general_features if self.adaptation is None else self.adaptation.general_features(audio)
            hmm, log_likelihoods = self.combined.hmm, combine_likelihoods(self.combined, cepstra, weight, general)
        audio.forget_warps()
        return hmm, penalise(hmm, log_likelihoods, find_quiet_frames(audio.log_energy), silent=False)


def _align_words(
    hmm: UnitHmm, log_likelihoods: LogLikelihoods, words: list[list[tuple[str, ...]]], anchors: Anchors | None
) -> tuple[list[SpokenWord], NDArray[np.intp]]:
    """Return words as they were pronounced, with silences and pauses, and the bounds of their units in frames."""

    def search(windows: Windows | None) -> list[PlacedWord]:
        return place_words(hmm, log_likelihoods, words, PAUSE, windows)

    of_units = None
    if anchors is None:
        spoken = [item.spoken for item in search(None)]
    else:
        from lipmotion.speech.recognition.anchors import align_within

        counts = dict(zip(hmm.table.units, hmm.table.counts, strict=True))
        edge, frames = counts[hmm.table.free[0]], log_likelihoods.frames
        shortest = {id(word): min(sum(counts[unit] for unit in variant) for variant in word) for word in words}
        min_frames = np.array([shortest[id(word)] for word in words], np.intp)
        placed, windows = align_within(anchors, min_frames, edge, frames, search)
        spoken = [item.spoken for item in placed]
        of_units = spread_windows(spoken, windows, frames)
    return spoken, align_units(hmm, log_likelihoods, [unit for item in spoken for unit in item.units], of_units)


def uses_network(kind: str) -> bool:
    """Return whether a kind of recogniser uses the phone recogniser, and it is installed."""
    return kind == "auto" and find_installed_recogniser() is not None


open_recogniser = lru_cache(maxsize=4)(Recogniser)
"""Returns the recogniser of some models; the last four are cached, with the networks that they search."""


def weigh_own_model(score: float) -> float:
    """Return the weight of own models beside the general ones, 0 to 1, at a speaker similarity score."""
    return min(max((score - STRANGER_SCORE) / (FULL_WEIGHT_SCORE - STRANGER_SCORE), 0.0), 1.0)
