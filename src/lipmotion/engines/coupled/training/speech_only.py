"""The second stage of training: densities of speech from recordings of many speakers, whose lips were not seen.

Xie & Liu split their trained model into one of speech and one of lips, train the first on more recordings, audio only,
and put both together again. Nothing need be split here: in a recording whose lips were not seen the visual streams are
integrated out, so its likelihood is that of a model of speech alone whose hidden states are the joint ones. A step of
EM that keeps visual densities and coupled transitions is therefore the step of the split model, and the chains stay
together.
Source: Xie & Liu 2007, §3.4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import HMM
from lipmotion.engines.coupled.conversion.em import speech_alone
from lipmotion.engines.coupled.training.train import (
    Labelled,
    Step,
    components,
    converged,
    recording,
    split,
    variance_floors,
)


@dataclass(frozen=True)
class MoreSpeech:
    """How the second stage goes on.

    mixtures : Gaussians per density of speech in the end, a power of two; never fewer than before
    steps    : of EM between one splitting and the next, at most
    weight   : how much a frame of the other speakers counts beside one of the first stage
    """

    mixtures: int
    steps: int
    weight: float


def with_more_speech(
    chains: Chains,
    own: Sequence[Labelled],
    others: Sequence[Labelled],
    how: MoreSpeech,
    heard: Callable[[Step], None] = lambda _: None,
    workers: int = 1,
) -> Chains:
    """Return chains whose densities of speech have learned from other speakers as well; all else is as it was.

    own    : what the chains were trained on; its speech is learned from again, without its lips
    others : speech alone; the visual streams may hold anything
    heard  : is told every step; within a number of components the log likelihood, by the weights, never falls
    Where speech and lips share their components (``hmm``), these stay as many, but their shares are learned again.
    """
    floors = variance_floors([one.observed for one in own])
    recordings = [
        recording(chains, replace(one, observed=speech_alone(one.observed)), weight)
        for group, weight in ((own, 1.0), (others, how.weight))
        for one in group
    ]
    now = components(chains)
    most = now if chains.structure.kind == HMM else (max(how.mixtures, now[0]), *now[1:])
    while True:
        chains, said = converged(chains, recordings, floors, how.steps, heard, workers, speech_only=True)
        if components(chains) == most:
            return chains
        chains = split(chains, most, said)
