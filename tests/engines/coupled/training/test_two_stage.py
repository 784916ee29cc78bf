from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import groupby

import numpy as np
import pytest

from lipmotion.engines.coupled.chains.densities import LEAST_COMPONENT_FRAMES, AudioVisualObservations
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import Structure, unit_sets
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.model import CoupledConfig, CoupledModel
from lipmotion.engines.coupled.training import chain_training
from lipmotion.engines.coupled.training.alignment import AlignedUtterance
from lipmotion.engines.coupled.training.coupled_training import train_on_speech
from lipmotion.stats.mixture import Mixtures
from lipmotion.testing.examples import RATE_HZ, examples
from lipmotion.types import Example, Motion, Span, Timeline, Unit, silent_monitor
from oracles.joint import mixture
from oracles.paths import posteriors

SMALL = {"articulation": False, "states": 1, "asynchrony": 0, "mixtures": 1, "speech_only_mixtures": 2, "components": 1}
PLAIN = {"acoustic_regression": False, "variance_scaling": False}
STRUCTURES = {"hmm": "phone", "multistream": "phone", "factorial": "phone viseme", "coupled": "phone viseme"}


def aligned(sentences: Sequence[Example]) -> list[AlignedUtterance]:
    """Speech with motion in two dimensions, and the phones in time; without motion, what nobody has seen is 0."""
    found = []
    for each in sentences:
        seen = each.motion.values[:, :2] if each.motion.channels else np.zeros((len(each.valid), 2))
        streams = each.speech.features.values, seen.astype(np.float32)
        found.append(AlignedUtterance(AudioVisualObservations(streams, (None, each.valid)), each.speech.units))
    return found


def second_stage(mixtures: int, steps: int, weight: float) -> CoupledConfig:
    return CoupledConfig(speech_only_mixtures=mixtures, speech_only_steps=steps, speech_only_weight=weight)


@cache
def trained(kind: str = "coupled", mixtures: int = 2) -> Chains:
    structure = Structure(kind, unit_sets(STRUCTURES[kind]), 2, 1)
    groups = 1 if kind == "hmm" else 2
    how = chain_training.MixtureSchedule((mixtures, 1)[:groups], (1.0, 1.0))
    *_, grown = chain_training.growing_chains(structure, ("speech", "lips"), aligned(examples(4)), how)
    return grown.model


def other_speaker(example: Example, seed: int = 5) -> Example:
    """The same sentence by a speaker with other features, without motion."""
    turned = np.linalg.qr(np.random.default_rng(seed).normal(size=(39, 39)))[0]
    values = example.speech.features.values
    mixed = (0.3 * values + 0.8 * values @ turned).astype(np.float32)
    features = replace(example.speech.features, values=mixed)
    frames = len(values)
    nothing = Motion(np.zeros((frames, 0)), RATE_HZ, ())
    return Example("other speaker", replace(example.speech, features=features), nothing, np.zeros(frames, bool))


def speech_alone(sentences: Sequence[Example]) -> list[AlignedUtterance]:
    return aligned([other_speaker(each) for each in sentences])


def three_frames() -> AlignedUtterance:
    """The end of a silence and the beginning of a t, with motion: so short that all paths can be tried."""
    (whole,) = aligned(examples(1))
    start = round(whole.phones.spans[1].start_s * RATE_HZ) - 2
    phones = Timeline((Span(0.0, 0.02, Unit("sil")), Span(0.02, 0.03, Unit("t"))))
    cut = slice(start, start + 3)
    seen = tuple(None if mask is None else mask[cut] for mask in whole.observations.observed)
    return AlignedUtterance(
        AudioVisualObservations(tuple(values[cut] for values in whole.observations.streams), seen), phones
    )


def speech_posteriors(chains: Chains, one: AlignedUtterance) -> np.ndarray:
    """Return the posterior of each density of speech [shape=(T, G)] in a model of speech alone, by all of its paths.

    Its states are the joint ones, its emissions those of speech, its moves the coupled ones.
    """
    lattice, mixtures = chain_training.lattice_utterance(chains, one).lattice, chains.groups[0].mixtures
    x, product = one.observations.streams[0], chains.transitions.product
    log = np.full((len(x), len(mixtures.means)), -np.inf)
    for frame, density in np.ndindex(log.shape):
        if lattice.allowed_units[frame, density // chains.structure.states]:
            terms = mixtures.log_weights[density], mixtures.means[density], mixtures.variances[density]
            log[frame, density] = mixture(x[frame], *terms)
    place = {state: number for number, state in enumerate(lattice.states.tolist())}
    arcs = {
        (place[int(product.arc_from[arc])], place[int(product.arc_to[arc])]): chains.transitions.arc_log[arc]
        for arc in lattice.transition_index
    }
    with np.errstate(divide="ignore"):
        first = np.log(product.initial[lattice.states])
    states = product.chain_states[0][lattice.states]
    found, _, _ = posteriors(log, states, arcs, first, np.zeros(len(states)))
    return np.stack([found[:, states == density].sum(axis=1) for density in range(log.shape[1])], axis=1)


def learned(before: Mixtures, density: int, gamma: np.ndarray, x: np.ndarray, floor: np.ndarray):
    """Return the weights, means and variances of one density after the textbook M-step, with variance floors.

    gamma : posterior of the density in each frame [shape=(T,)]
    """
    parts = [
        [mixture(frame, [share], [mean], [variance]) for share, mean, variance in zip(*components, strict=True)]
        for components in [(before.log_weights[density], before.means[density], before.variances[density])]
        for frame in x
    ]
    weight = np.exp(parts - np.logaddexp.reduce(parts, axis=1)[:, None]) * gamma[:, None]
    total = weight.sum(axis=0)
    means, variances = before.means[density].astype(float), before.variances[density].astype(float)
    for part in np.flatnonzero(total > LEAST_COMPONENT_FRAMES):
        means[part] = weight[:, part] @ x / total[part]
        variances[part] = np.maximum(weight[:, part] @ (x - means[part]) ** 2 / total[part], floor)
    return total / total.sum(), means, variances


@pytest.mark.long
def test_a_step_is_that_of_the_split_model() -> None:
    """Speech of the first stage and of other speakers: the same utterance, with weights 1 and 49."""
    chains, own = trained(), three_frames()
    other = replace(own, observations=own.observations.without_stream(1))
    found = train_on_speech(chains, [own], [other], second_stage(2, 1, 49.0)).groups[0].mixtures
    gamma, x = 50 * speech_posteriors(chains, own), own.observations.streams[0]
    before, (floor, _) = chains.groups[0].mixtures, chain_training.variance_floors([own.observations])
    visited = np.flatnonzero(gamma.sum(axis=0) >= 3)
    assert len(visited) >= 3
    for density in visited:
        shares, means, variances = learned(before, density, gamma[:, density], x, floor)
        assert np.exp(found.log_weights[density]) == pytest.approx(shares, abs=1e-3)
        assert found.means[density] == pytest.approx(means, abs=1e-3)
        assert found.variances[density] == pytest.approx(variances, rel=1e-2, abs=1e-3)
    others = np.setdiff1d(np.arange(len(before.means)), visited)
    assert found.select(others).means.tobytes() == before.select(others).means.tobytes()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["hmm", "coupled"])
def test_every_step_raises_the_likelihood(kind: str) -> None:
    steps: list[chain_training.TrainingStep] = []
    own, others = aligned(examples(4)), speech_alone(examples(4, seed=9))
    train_on_speech(trained(kind), own, others, second_stage(4, 6, 0.5), steps.append)
    for _, run in groupby(steps, lambda step: step.mixtures):
        figures = [step.log_likelihood for step in run]
        assert len(figures) > 2
        assert np.diff(figures).min() > -1e-3
        assert figures[1] > figures[0] + 0.1
    assert {step.mixtures[0] for step in steps} == ({2} if kind == "hmm" else {2, 4})


@pytest.mark.parametrize("kind", ["coupled", pytest.param("multistream", marks=pytest.mark.long)])
def test_visual_densities_and_transitions_stay(kind: str) -> None:
    chains = trained(kind)
    found = train_on_speech(chains, aligned(examples(3)), speech_alone(examples(3, seed=9)), second_stage(4, 2, 1.0))
    assert found.transitions is chains.transitions
    before, after = chains.groups[-1].stream_mixtures(1), found.groups[-1].stream_mixtures(1)
    assert after.means.tobytes() == before.means.tobytes()
    assert after.variances.tobytes() == before.variances.tobytes()
    assert (
        np.abs(found.groups[0].stream_mixtures(0).means[:, :2] - chains.groups[0].stream_mixtures(0).means).max() > 0.1
    )


def test_a_weight_is_how_often_an_utterance_counts() -> None:
    chains, (one,) = trained(), aligned(examples(1))
    twice = chain_training.e_step(chains, [chain_training.lattice_utterance(chains, one)] * 2)
    heavy = chain_training.e_step(chains, [chain_training.lattice_utterance(chains, one, 2.0)])
    assert heavy.frames == twice.frames
    assert heavy.log_likelihood == pytest.approx(twice.log_likelihood)
    assert heavy.transition_counts == pytest.approx(twice.transition_counts, abs=1e-5)
    for a, b in zip(heavy.emissions, twice.emissions, strict=True):
        assert a.occupancy == pytest.approx(b.occupancy, abs=1e-4)
        assert a.products[0] == pytest.approx(b.products[0], abs=1e-2)


def fitted(sentences: Sequence[Example], **options: object) -> tuple[CoupledEngine, CoupledModel]:
    engine = CoupledEngine(CoupledConfig(**SMALL | options))
    return engine, engine.fit(sentences, silent_monitor).model


def arrays(sentences: Sequence[Example], **options: object) -> list[bytes]:
    engine, model = fitted(sentences, **PLAIN | options)
    return [array.tobytes() for array in engine.to_arrays(model).values()]


def test_motion_that_was_not_observed_is_ignored_wherever_the_example_stands() -> None:
    moving, speech_only = examples(4), [other_speaker(one) for one in examples(3, seed=9)]
    channels = [
        replace(
            one, motion=replace(moving[0].motion, values=np.full((len(one.valid), len(moving[0].motion.channels)), 9.0))
        )
        for one in speech_only
    ]
    first = arrays([*moving, *speech_only])
    assert first == arrays([speech_only[0], moving[0], *channels[1:], *moving[1:]])
    assert first != arrays(moving)


def right(engine: CoupledEngine, model: CoupledModel, sentence: Example) -> tuple[float, float]:
    """Return the correlation of the opening with the original's, of unknown words, and of speech frames right."""
    spoken = replace(sentence.speech, units_known=False)
    generated = engine.generate(model, spoken).motion["opening"]
    observations = model.speech_observations(spoken)
    chains = model.chains
    found = chains.posteriors(chains.emission_log_densities(observations, chains.full_lattice), chains.full_lattice)
    states = found.chains[0].argmax(axis=1) // chains.structure.states
    labels = [
        (chains.structure.units[0].index(span.label.phone), frame)
        for span in spoken.units
        if span.label.phone != "sil"
        for frame in range(round(span.start_s * RATE_HZ), round(span.end_s * RATE_HZ))
    ]
    share = float(np.mean([states[frame] == unit for unit, frame in labels]))
    return float(np.corrcoef(generated, sentence.motion["opening"])[0, 1]), share


@pytest.mark.long
def test_another_speaker_is_recognised_and_the_first_one_still_is() -> None:
    moving, speech_only = examples(6), [other_speaker(one) for one in examples(6, seed=9)]
    (own,), (original,) = examples(1, seed=20), examples(1, seed=21)
    other = replace(original, speech=other_speaker(original).speech)
    one, two = fitted(moving), fitted([*moving, *speech_only])
    before, after = right(*one, other), right(*two, other)
    assert after[0] > before[0] + 0.1
    assert after[1] > before[1] + 0.2
    assert right(*two, own) > (0.9, 0.9)
