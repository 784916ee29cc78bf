"""The fit of a transcript: whether it is what is said in a recording, and where speech is missing in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.loudness import find_loud_frames, find_quiet_frames
from lipmotion.speech.recognition.general import STATES, find_density, load_general
from lipmotion.speech.recognition.network.posteriors import POSTERIOR_STEP
from lipmotion.speech.recognition.transcript_evidence import TranscriptEvidence, WordEvidence, join_near, label_evidence
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.types import FRAME_RATE_HZ, Audio, Span, Timeline, Unit, frames_of
from lipmotion.units import is_silent

DOUBTFUL_SCORE = -4.2
"""Under this score the transcript is probably wrong: right ones score 0 to -4.1, wrong ones -2 to -8."""
WORST_SCORE = -9.0
"""No frame counts for less: a sound that a voice makes in its own way, as synthetic ones do, does not decide alone."""
FRAME_STEP = 4  # only every fourth frame is scored: its neighbours are much like it
LONG_PHONE_S, LONG_PHONE_SCORE, MIN_LOUD_S = 0.35, -4.0, 0.2
"""A phone that lasts as long, agrees with the sound less and is loud for as long is stretched over speech that the
transcript leaves out. A sound that is drawn out lasts longer, too, but agrees; a pause before a word is quiet."""
MIN_VOICE_S = 1.0
"""Silence with so much loud sound in it is speech that the transcript leaves out; breath and coughs are shorter."""
MIN_IDLE_S = 0.3  # given phones in silence for so long are doubted
MIN_FITTING_SHARE = 0.9  # a transcript that fits less of the speech is worth a remark
Place = tuple[float, float]  # start and end in seconds


@dataclass(frozen=True)
class TranscriptFit:
    """How well a transcript fits a recording."""

    score: float
    """How well phones agree with the sound: mean over phones of the mean over their frames of the log density of the
    phone less that of the best one (at least ``WORST_SCORE``); 0 where none is more probable, or nothing is said."""
    missing: tuple[Place, ...]  # stretches with speech that the transcript leaves out, in order
    speech_s: float  # seconds of speech in the recording, those that are missing included
    evidence: TranscriptEvidence | None = None  # by a phone recogniser; where there is some, it decides
    idle: tuple[Place, ...] = ()  # of phones that are given with their times: stretches in which nothing is said
    wrong: tuple[Place, ...] = ()  # of such phones: stretches in which others are said

    @property
    def is_doubtful(self) -> bool:
        """Whether the transcript seems to be of something else."""
        return self.evidence.is_doubtful if self.evidence is not None else self.score < DOUBTFUL_SCORE

    @property
    def unsaid(self) -> tuple[WordEvidence, ...]:
        """The words that seem not to be said."""
        return self.evidence.unsaid if self.evidence is not None else ()

    @property
    def missing_s(self) -> float:
        """Seconds that the stretches of ``missing`` last together."""
        return sum(end_s - start_s for start_s, end_s in self.missing)

    @property
    def share(self) -> float:
        """The share of the speech that the transcript fits, 0 to 1; 0 where the transcript is of something else."""
        if self.is_doubtful:
            return 0.0
        doubted_s = self.missing_s + sum(end_s - start_s for start_s, end_s in (*self.idle, *self.wrong))
        return 1.0 - min(doubted_s / max(self.speech_s, 1e-9), 1.0)

    @property
    def is_partial(self) -> bool:
        """Whether the transcript fits so little of the speech that this is worth a remark."""
        return self.share < MIN_FITTING_SHARE

    def of_frames(self, count: int) -> NDArray[np.float64]:
        """Return in which frames the transcript fits: 1; 0 where it does not [shape=(count,)]."""
        fits = np.full(count, 0.0 if self.is_doubtful else 1.0)
        for start_s, end_s in (*self.missing, *self.idle, *self.wrong):
            fits[slice(*frames_of(Span(start_s, end_s, ""), count))] = 0
        return fits


def measure_fit(audio: Audio, units: Timeline[Unit]) -> TranscriptFit:
    """Return how well the aligned phones of a transcript fit a recording.

    audio : an ``AnalysedAudio`` shares its features with what else is computed of it
    units : of the audio, as ``Recogniser.align`` returns them
    Forced alignment finds a place for every word, and fills the recording with them: where the transcript leaves words
    out, it stretches phones of their neighbours (``LONG_PHONE_S``), or calls loud sound silence (``MIN_VOICE_S``).
    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    analysis = analysed(audio)
    frames, scores, mean = _score_frames(analysis, units)
    loud = find_loud_frames(analysis.log_energy)
    missing, speech_s = [], 0.0
    for span in units:
        first, stop = frames_of(span, len(loud))
        loud_s = (first + np.flatnonzero(loud[first:stop])) / FRAME_RATE_HZ
        if is_silent(span.label.phone):
            if len(loud_s) >= MIN_VOICE_S * FRAME_RATE_HZ:
                missing.append((float(loud_s[0]), float(loud_s[-1]) + 1 / FRAME_RATE_HZ))
                speech_s += missing[-1][1] - missing[-1][0]
        else:
            speech_s += span.duration_s
            if span.duration_s >= LONG_PHONE_S and len(loud_s) >= MIN_LOUD_S * FRAME_RATE_HZ:
                inside = slice(*np.searchsorted(frames, (first, stop)))
                if float(scores[inside].mean()) < LONG_PHONE_SCORE:
                    missing.append((span.start_s, span.end_s))
    return TranscriptFit(mean, join_near(*np.reshape(missing, (-1, 2)).T), speech_s)


def label_fit(audio: AnalysedAudio, units: Timeline[Unit], log_posteriors: NDArray[np.float64] | None) -> TranscriptFit:
    """Return how well phones that are given with their times fit a recording.

    log_posteriors : of a phone recogniser that is sure of what is said, every ``POSTERIOR_STEP`` frames; None: there is
                     none, and only the loudness is compared
    Raises MissingDependencyError: pocketsphinx is not installed.
    """
    spoken = [span for span in units if not is_silent(span.label.phone)]
    if log_posteriors is not None:
        heard, idle, wrong = label_evidence(log_posteriors, POSTERIOR_STEP / FRAME_RATE_HZ, units)
        loud_s = np.flatnonzero(find_loud_frames(audio.log_energy)) / FRAME_RATE_HZ
        loud = join_near(loud_s, loud_s + 1 / FRAME_RATE_HZ)
        unlabelled = list[Place]()
        for start_s, end_s in heard:  # all the sound around it, as far as no phone is given
            before_s = max((span.end_s for span in spoken if span.end_s <= start_s), default=0.0)
            after_s = min((span.start_s for span in spoken if span.start_s >= end_s), default=np.inf)
            around = [each for each in loud if each[0] < end_s and each[1] > start_s] or [(start_s, end_s)]
            first_s, last_s = min(around[0][0], start_s), max(around[-1][1], end_s)
            unlabelled.append((max(first_s, before_s), min(last_s, after_s)))
        missing = tuple(unlabelled)
    else:
        quiet = find_quiet_frames(audio.log_energy)
        silent = [span for span in spoken if quiet[slice(*frames_of(span, len(quiet)))].all()]
        idle = join_near([span.start_s for span in silent], [span.end_s for span in silent], min_s=MIN_IDLE_S)
        missing, wrong = measure_fit(audio, units).missing, ()
    speech_s = sum(span.duration_s for span in spoken) + sum(end_s - start_s for start_s, end_s in missing)
    return TranscriptFit(0.0, missing, speech_s, None, idle, wrong)


def _score_frames(audio: AnalysedAudio, units: Timeline[Unit]) -> tuple[NDArray[np.intp], NDArray[np.float32], float]:
    """Return every fourth frame of speech, how well its phone agrees with the sound there, and the agreement score."""
    spoken = [span for span in units if not is_silent(span.label.phone)]
    each = [np.arange(*frames_of(span, audio.frames)) for span in spoken]
    phones = np.repeat(np.arange(len(spoken)), [len(of_span) for of_span in each])
    first = np.array([find_density(span.label.phone, 0, STATES) for span in spoken], np.intp)[phones]
    frames = np.concatenate([np.zeros(0, np.intp), *each])
    frames, phones, states = (rows[::FRAME_STEP] for rows in (frames, phones, first))
    if not len(frames):
        return frames, np.zeros(0, np.float32), 0.0
    log_densities = load_general().log_density(audio.general_features[frames])
    of_phone = np.take_along_axis(log_densities, states[:, None] + np.arange(STATES), axis=1)
    scores, counts = of_phone.max(axis=1), np.bincount(phones)
    sums = np.bincount(phones, np.maximum(scores, WORST_SCORE))
    return frames, scores, float((sums[counts > 0] / counts[counts > 0]).mean())  # every phone counts the same
