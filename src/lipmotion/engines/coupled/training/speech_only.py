"""The second stage of training: densities of speech from recordings of many speakers, without motion.

Xie & Liu split their trained model into one of speech and one of lips, train the first on more recordings of speech
alone, and join both again. Here nothing needs to be split. In a recording without motion the visual streams are
integrated out, so its likelihood is that of a model of speech alone whose hidden states are the joint states. A step of
EM that keeps the visual densities and the coupled transitions is therefore the step of the split model.
Source: Xie & Liu 2007, §3.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import HMM
from lipmotion.engines.coupled.conversion.em import without_visual_streams
from lipmotion.engines.coupled.training.alignment import AlignedUtterance
from lipmotion.engines.coupled.training.em_steps import lattice_utterance, variance_floors
from lipmotion.engines.coupled.training.train import (
    Report,
    component_counts,
    no_report,
    train_to_convergence,
    with_split_components,
)


@dataclass(frozen=True)
class SpeechOnlySchedule:
    """How many Gaussians the densities of speech get in the second stage, and how many steps of EM.

    mixtures   : Gaussians per density of speech in the end, a power of two; never fewer than before
    most_steps : greatest number of EM steps between one splitting and the next
    weight     : of a frame of the other speakers, relative to a frame of the first stage
    """

    mixtures: int
    most_steps: int
    weight: float


def train_on_speech(
    chains: Chains,
    data: Sequence[AlignedUtterance],
    speech_only: Sequence[AlignedUtterance],
    schedule: SpeechOnlySchedule,
    report: Report = no_report,
    workers: int = 1,
) -> Chains:
    """Return chains whose densities of speech are re-estimated from other speakers as well; all else stays.

    data        : what the chains were trained on; its speech is used here too, without its motion
    speech_only : utterances of other speakers; the values of their visual streams are ignored
    report      : is called after every step; while the number of components stays, the weighted log likelihood never
                  falls
    Where speech and motion share their components (``hmm``), these stay as many, but their weights are re-estimated.
    """
    floors = variance_floors([utterance.observations for utterance in data])
    utterances = [
        lattice_utterance(
            chains, replace(utterance, observations=without_visual_streams(utterance.observations)), weight
        )
        for group, weight in ((data, 1.0), (speech_only, schedule.weight))
        for utterance in group
    ]
    present = component_counts(chains)
    most = present if chains.structure.kind == HMM else (max(schedule.mixtures, present[0]), *present[1:])
    while True:
        result = train_to_convergence(
            chains, utterances, floors, schedule.most_steps, report, workers, speech_only=True
        )
        if component_counts(result.model) == most:
            return result.model
        chains = with_split_components(result.model, most, result.statistics)
