"""Motion for voices that training does not know: mouths that open before speech begins, vowels that open by their
duration, and movements as large as people's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.articulation import (
    ARTICULATORS,
    TYPICAL_DEVIATIONS,
    ArticulationPrior,
    Statistics,
    average_classes,
    slice_dynamics,
    smooth_steps,
    unseen_share,
)
from lipmotion.motion.closure import OPENING, REACH_S
from lipmotion.motion.space import MotionSpace
from lipmotion.types import EYE_DISTANCE, FRAME_RATE_HZ, Timeline, Unit, frames_of
from lipmotion.units import VOWELS, is_silent

Array = NDArray[np.float64]
Predict = Callable[[slice], Statistics]
SOUND_SHARES = (0.75, 0.35)
"""Share of the motion that the general network hears, after all that is done for such a voice, where training knows it
half or less: where phones cannot be relied on at all, and where they can (docs/results/voices.md)."""
NOISY_SHARE = 0.3
"""The same of a voice that training knows, where noise makes its phones unreliable; none where they are reliable."""
CONFIRMED = -0.5
"""An unreliable p, b or m closes the lips where the general network hears them less open than so many deviations."""
NEAR_FRAMES = 20
"""Frames before and after speech in which that holds: elsewhere the mouth rests."""
VOWEL_S, OPENING_BY_DURATION = 0.1, 0.5
"""A vowel of the first duration is as open as the table says; one that is e times as long is more open by so many
standard deviations of the speaker, and a shorter one less (docs/results/voices.md)."""
CONSONANT_CLOSING = 0.25
"""Consonants are less open than the table says, by so many standard deviations of the speaker: a fifth to a third of
the phones that it was measured on are wrong, so that it has vowels too closed and consonants too open."""
BREATH_S = 0.6
"""So long before the first phone such a mouth is as open as in speech: people part their lips and breathe in."""
SURE_PHONES = 5000
"""Models of so many phones in training, some twelve minutes, know their own speaker; those of 50 sentences take his
voice for 0.85 of a known one (docs/results/jerk.md), no more than the large model some strangers of the same studio."""
INSET_S = 0.03
"""The lips of such a voice close in p, b and m further than this from both ends of the phone, or in its middle, so that
short vowels beside it stay open."""
RETAINED = (1.0, 0.85)
"""Standard deviation of what is generated for voices that training does not know, as a share of that of its speaker:
where phones cannot be relied on at all, and where they can. The general network moves a mouth as far as people do."""


@dataclass(frozen=True, eq=False)
class UnseenSpeaker:
    """What is changed in the motion of a voice that training does not know; precisions stay those of the model.

    prior       : the table of articulation
    units       : phones in time, in T frames
    reliability : of the phones in time, 0 to 1 [shape=(T,)]
    voice       : how well training knows the voice, 0 to 1; at 1 it only follows the sound in noise
    Every method takes and returns a function that returns means and precisions of a range of frames.
    """

    prior: ArticulationPrior
    units: Timeline[Unit]
    frames: int
    reliability: Array | float
    voice: float

    def follow_sound(self, statistics: Predict, articulators: Array) -> Predict:
        """Draw the motion in and near speech towards what the general network hears in the sound.

        articulators : of ``motion.general_motion`` [shape=(T, 8)]
        """
        spoken = np.zeros((self.frames, 1))
        for span in self.units:
            if not is_silent(span.label.phone):
                first, stop = frames_of(span, self.frames)
                spoken[max(first - NEAR_FRAMES, 0) : stop + NEAR_FRAMES] = 1
        unsure, sure = SOUND_SHARES
        reliability = np.broadcast_to(self.reliability, self.frames)[:, None, None]
        strange = unseen_share(self.voice)
        share = strange * (unsure + reliability * (sure - unsure)) + (1 - strange) * NOISY_SHARE * (1 - reliability)
        share = share * smooth_steps(spoken)[:, :, None]
        heard = self.prior.centre + articulators @ self.prior.matrix

        def predict(chosen: slice) -> Statistics:
            means, precisions = statistics(chosen)
            return means + share[chosen] * (slice_dynamics(heard, chosen) - means), precisions

        return predict

    def confirm_closures(self, ranges: Sequence[slice], articulators: Array) -> list[slice]:
        """Return the ranges of frames in which a p, b or m can be relied on, or the general network hears one.

        articulators : of ``motion.general_motion`` [shape=(T, 8)]
        """
        reliability, opening = np.broadcast_to(self.reliability, self.frames), articulators[:, 0]
        return [r for r in ranges if reliability[r].mean() > 0.5 or opening[r].min() < CONFIRMED]

    def raise_contrast(self, statistics: Predict) -> Predict:
        """Open consonants less, and vowels by their duration.

        All articulators move as from the mean consonant to the mean vowel of the table.
        Source: Lindblom 1963 (vowel reduction): the shorter a vowel, the more it misses its target.
        """
        wider = np.zeros((self.frames, 1))
        for span in self.units:
            inside, phone = slice(*frames_of(span, self.frames)), span.label.phone
            if phone in VOWELS:
                wider[inside] = OPENING_BY_DURATION * np.log(max(span.duration_s, 1 / FRAME_RATE_HZ) / VOWEL_S)
            elif phone and not is_silent(phone):
                wider[inside] = -CONSONANT_CLOSING
        more_open = (average_classes()[True] - average_classes()[False]).mean(axis=0)
        more_open /= more_open[ARTICULATORS.index(OPENING)]
        gain = unseen_share(self.voice) * np.broadcast_to(self.reliability, self.frames)[:, None]
        change = gain * smooth_steps(wider) * more_open @ self.prior.matrix

        def predict(chosen: slice) -> Statistics:
            means, precisions = statistics(chosen)
            return means + slice_dynamics(change, chosen), precisions

        return predict

    def open_before_speech(self, statistics: Predict) -> Predict:
        """Open the mouth before speech begins.

        All dimensions are drawn towards their median in speech. A model of few phones half knows its own speaker's
        voice, too: the fewer it was trained on, the less changes.
        Source: Scobbie, Schaeffler & Mennen 2011 (lips part and breath is taken before the first sound).
        """
        first_s = next((span.start_s for span in self.units if not is_silent(span.label.phone)), 0.0)
        time_s = np.arange(self.frames) / FRAME_RATE_HZ
        before = ((time_s >= first_s - BREATH_S) & (time_s < first_s))[:, None].astype(float)
        sure = min(sum(self.prior.contexts.values()) / SURE_PHONES, 1)
        strange = max(2 * np.sqrt(self.voice), 1.0) * unseen_share(self.voice) * sure
        share = strange * np.broadcast_to(self.reliability, self.frames)[:, None] * smooth_steps(before)
        pose = np.stack([self.prior.centre, *np.zeros((2, len(self.prior.centre)))])

        def predict(chosen: slice) -> Statistics:
            means, precisions = statistics(chosen)
            return means + share[chosen, :, None] * (pose - means), precisions

        return predict


def choose_closing_reach(voice: float) -> float:
    """Return how many seconds before and after a p, b or m the lips may close; negative: seconds within it.

    voice : how well training knows the voice, 0 to 1
    """
    return REACH_S - unseen_share(voice) * (REACH_S + INSET_S)


def widen_range(prior: ArticulationPrior, space: MotionSpace, voice: float, reliability: float) -> float:
    """Return the factor by which movements reach the range of typical talkers, at least 1.

    prior       : the table of articulation, which knows the range of the model's speaker
    space       : of the motion; the factor is 1 where its opening is not in eye distances
    voice       : how well training knows the voice, 0 to 1; at 1 the range is that of the speaker, and the factor 1
    reliability : of the phones, 0 to 1, on average
    """
    column, row = space.direct_names.index(OPENING), ARTICULATORS.index(OPENING)
    if space.channels[space.direct[column]].unit != EYE_DISTANCE:
        return 1.0
    typical = TYPICAL_DEVIATIONS[row]
    speaker_deviation = prior.matrix[row, column] ** 2 / typical
    generated = speaker_deviation * float(np.interp(reliability, (0, 1), RETAINED))
    return float(max(typical / generated, 1.0) ** (1 - voice))
