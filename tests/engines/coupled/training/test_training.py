"""Streams with a known lag: chains that may be apart must be better than one, and no worse without a lag."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import groupby, pairwise
from typing import Any

import numpy as np
import pytest

from engines.coupled.tiny import (
    COUPLED,
    FACTORIAL,
    HMM,
    MULTISTREAM,
    SYSTEMS,
    THREE,
    TWO,
    chains,
    observations,
    structure,
)
from lipmotion import engines, errors
from lipmotion.engines import engine_named
from lipmotion.engines.coupled.chains.densities import MIN_COMPONENT_FRAMES, AudioVisualObservations, reestimate_group
from lipmotion.engines.coupled.chains.lattice import FactorialTransitions
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.product import list_unit_sets
from lipmotion.engines.coupled.conversion import EXACT, VITERBI, convert
from lipmotion.engines.coupled.training.chain_training import (
    CONVERGENCE_GAIN,
    AlignedUtterance,
    LatticeUtterance,
    build_lattice_utterance,
    compute_variance_floors,
    count_components,
    e_step,
    grow_chains,
    mark_allowed_units,
    split_evenly,
)
from lipmotion.engines.coupled.training.coupled_training import train_on_speech
from lipmotion.measures.curves import correlate_pooled
from lipmotion.testing import examples
from lipmotion.types import FRAME_RATE_HZ, GREY, Channel, Example, Motion, Span, Timeline, Unit, silent_monitor
from oracles import coupled as oracle
from oracles.joint import mixture
from oracles.paths import posteriors

PHONES = ("p", "uw", "aa", "b", "aa", "uw")


def sentences(count=6, frames_each=9, seed=0) -> list[AlignedUtterance]:
    """Speech and motion for the phones, motion a little ahead."""
    made = []
    for number in range(count):
        draw = np.random.default_rng([seed, number])
        phones = [str(phone) for phone in draw.permutation(PHONES)]
        edges = np.arange(len(phones) + 1) * frames_each / 100
        spans = tuple(Span(a, b, Unit(p)) for (a, b), p in zip(pairwise(edges.tolist()), phones, strict=True))
        index = np.repeat([THREE.units.index(THREE.unit(p)) for p in phones], frames_each)
        early = np.append(index[2:], index[-1:].repeat(2))
        speech = draw.normal(0, 0.4, (len(index), 2)) + np.stack([index == 0, index == 1], axis=1) * 2
        seen = draw.normal(0, 0.3, (len(index), 1)) + (early == THREE.units.index("closed"))[:, None] * 2
        streams = AudioVisualObservations((speech.astype(np.float32), seen.astype(np.float32)), (None, None))
        made.append(AlignedUtterance(streams, Timeline(spans)))
    return made


class Steps(list[tuple[tuple[int, ...], float]]):
    """The numbers of components, and the mean log likelihood, of every step of EM."""

    def __call__(self, _: int, chains: Any, statistics: Any) -> None:
        self.append((count_components(chains), statistics.mean_log_likelihood))


@pytest.mark.parametrize(
    ("kind", "sets", "limit"),
    [(COUPLED, (THREE, TWO), 1), (FACTORIAL, (THREE, TWO), 1), (FACTORIAL, (THREE, TWO), None),
     (MULTISTREAM, (THREE,), 1), (HMM, (THREE,), 1)],
)  # fmt: skip
def test_the_likelihood_rises_at_every_step(kind, sets, limit):
    steps = Steps()
    of, mixtures = structure(kind, sets, states=3, limit=limit), (4,) if kind == HMM else (4, 2)
    *_, grown = grow_chains(of, ("speech", "seen"), sentences(), mixtures, (1.0, 1.0), steps)
    assert grown.converged is bool(steps[-1][1] - steps[-2][1] < CONVERGENCE_GAIN)
    assert {mixtures[0] for mixtures, _ in steps} == {1, 2, 4}
    if limit is None:
        assert len(grown.model.transitions.own_density_states) > 5
    for (one, before), (other, after) in pairwise(steps):
        if one == other:
            assert after >= before - 1e-5


def test_densities_are_weighted_means_and_variances():
    """Eqs. A.12 to A.15 of Xie & Liu 2007, by enumeration of paths and components."""
    model = chains()
    data = [observations(4, seed=1), observations(4, seed=2)]
    statistics = e_step(model, [LatticeUtterance(one, model.full_lattice) for one in data])
    joints = [oracle.posteriors(model, one)[0] for one in data]
    compared = 0
    for stream, (group, own) in enumerate(zip(model.groups, statistics.emissions, strict=True)):
        better = reestimate_group(group, own, [np.float32([1e-6])], 0.0, (0, 1)).mixtures
        values = np.concatenate([one.streams[stream] for one in data]).astype(float)
        for density in range(group.mixtures.size[0]):
            gamma = np.concatenate(
                [
                    joint[frame, group.tie == density].sum() * np.exp(terms - total)[None]
                    for one, joint in zip(data, joints, strict=True)
                    for frame in range(one.frames)
                    for total, terms in [oracle.log_density(group, density, one, frame)]
                ]
            )
            occupancy = gamma.sum(axis=0)
            np.testing.assert_allclose(np.exp(better.log_weights[density]), occupancy / occupancy.sum(), atol=1e-3)
            for component in np.flatnonzero(occupancy > 0.2):
                share = gamma[:, component] / occupancy[component]
                mean = share @ values
                np.testing.assert_allclose(better.means[density, component], mean, atol=1e-3)
                variance = share @ (values - mean) ** 2
                np.testing.assert_allclose(better.variances[density, component], variance, atol=2e-3)
                compared += 1
    assert compared > 10


def test_no_recording_has_a_path_and_options_that_cannot_be():
    model = chains()
    lattice = replace(model.full_lattice, allowed_units=np.zeros((3, 3), bool))
    with pytest.raises(errors.InputError, match="labels"):
        e_step(model, [LatticeUtterance(observations(3), lattice)])
    for options in ({"mixtures": 3}, {"asynchrony": -2}, {"structure": "ring"}, {"audio_weight": -1.0}):
        with pytest.raises(errors.InputError):
            engines.engine_named("coupled", options)


def test_allowed_units_are_those_of_labels_near_a_frame():
    of = structure()
    phones = Timeline((Span(0.0, 0.2, Unit("p")), Span(0.2, 0.4, Unit("aa"))))
    allowed = mark_allowed_units(of, phones, 60)
    closed, opened = of.units[0].index("closed"), of.units[0].index("open")
    assert allowed[:25, closed].all()
    assert not allowed[26:34, closed].any()
    assert allowed[15:45, opened].all()
    assert not allowed[:14, opened].any()
    assert allowed[45:, closed].all()  # silence, where nothing is labelled
    assert allowed.any(axis=1).all()


def test_labels_are_divided_into_equal_parts():
    of = structure(states=3)
    product = chains(of).transitions.product
    path = split_evenly(product, Timeline((Span(0.0, 0.06, Unit("uw")), Span(0.06, 0.09, Unit("p")))), 9)
    states = [product.joint_states[s].states for s in path]
    assert states == [(0, 0), (0, 0), (1, 1), (1, 1), (2, 2), (2, 2), (0, 0), (1, 1), (2, 2)]


def test_floors_are_of_observed_frames():
    seen = np.arange(40) < 20
    values = np.where(seen, np.tile([0.0, 2.0], 20), 1e6)[:, None].astype(np.float32)
    data = AudioVisualObservations((np.zeros((40, 2), np.float32), values), (None, seen))
    assert compute_variance_floors([data])[1] == pytest.approx(0.01)


def with_pictures(number: int) -> Example:
    """An example with a mouth picture: one eigenlip that depends on the opening."""
    plain = examples(number + 1)[number]
    grey = (500 * plain.motion["opening"] - 40)[:, None]
    channels = (*plain.motion.channels, Channel("lips_r_01", GREY))
    return replace(
        plain, motion=replace(plain.motion, values=np.hstack([plain.motion.values, grey]), channels=channels)
    )


@pytest.mark.long
def test_every_stream_has_a_chain_and_a_weight_of_its_own():
    """Speech, points and pictures on three chains."""
    data = [with_pictures(number) for number in range(5)]
    weights = {"visual_weight": 0.5, "eigenlips_weight": 0.25}
    engine = engines.engine_named("coupled", {"chains": "phone viseme viseme", "states": 2, "mixtures": 1} | weights)
    model = engine.fit(data, silent_monitor).model
    assert model.chains.streams == ("speech", "geometry", "eigenlips")
    assert [group.weights for group in model.chains.groups] == [(1.0,), (0.5,), (0.25,)]
    assert [stream.name for stream in model.visual] == ["geometry", "eigenlips"]
    assert len(model.chains.structure.chains) == 3
    generated = engine.generate(model, data[0].speech).motion
    for name in ("opening", "lips_r_01"):
        assert np.corrcoef(generated[name], data[0].motion[name])[0, 1] > 0.8


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * ("FHMM" in name)) for name in SYSTEMS])
def test_a_preset_is_the_system_of_the_paper(name):
    """Table 2: 47 phones, or 13 visemes, of five states; 39 features of speech; eigenlips; streams of equal weight."""
    data = [with_pictures(number) for number in range(2)]
    lips = [replace(one, motion=one.motion.selected(["lips_r_01"])) for one in data]
    chains = engines.create_engine(preset=f"xieliu2007 {name}").fit(lips, silent_monitor).model.chains
    of, streams = chains.structure, [group.streams for group in chains.groups]
    visual = {"HMM": [], "MSHMM": []}.get(name[3:], [13 if "-vi-" in name else 47])
    assert [len(units) for units in of.units] == [47, *visual]
    assert of.state_counts == tuple(5 * len(units) for units in of.units)
    assert (chains.streams, streams) == (("speech", "eigenlips"), [(0, 1)] if name == "ph-HMM" else [(0,), (1,)])
    sizes = [group.mixtures.size for group in chains.groups]
    assert [size[1:] for size in sizes] == ([(1, 40)] if name == "ph-HMM" else [(1, 39), (1, 1)])
    assert {weight for group in chains.groups for weight in group.weights} == {1.0}
    assert isinstance(chains.transitions, FactorialTransitions) == ("FHMM" in name)  # no limit, no coupling
    if "CHMM" in name:
        assert np.abs(chains.transitions.product.lead).max() == 1
        assert len(chains.transitions.advance[1]) != of.state_counts[1]  # depends on the states of both chains


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


def second_stage(mixtures: int, steps: int, weight: float) -> Any:
    options = {"speech_only_mixtures": mixtures, "speech_only_steps": steps, "speech_only_weight": weight}
    return engine_named("coupled", options).config


@cache
def trained(kind: str = "coupled", mixtures: int = 2) -> Any:
    of = structure(kind, list_unit_sets(STRUCTURES[kind]))
    groups = 1 if kind == "hmm" else 2
    *_, grown = grow_chains(of, ("speech", "lips"), aligned(examples(4)), (mixtures, 1)[:groups], (1.0, 1.0))
    return grown.model


def other_speaker(example: Example, seed: int = 5) -> Example:
    """The same sentence by a speaker with other features, without motion."""
    turned = np.linalg.qr(np.random.default_rng(seed).normal(size=(39, 39)))[0]
    values = example.speech.features.values
    mixed = (0.3 * values + 0.8 * values @ turned).astype(np.float32)
    features = replace(example.speech.features, values=mixed)
    frames = len(values)
    nothing = Motion(np.zeros((frames, 0)), FRAME_RATE_HZ, ())
    return Example("other speaker", replace(example.speech, features=features), nothing, np.zeros(frames, bool))


def speech_alone(sentences: Sequence[Example]) -> list[AlignedUtterance]:
    return aligned([other_speaker(each) for each in sentences])


def three_frames() -> AlignedUtterance:
    """The end of a silence and the beginning of a t, with motion: so short that all paths can be tried."""
    (whole,) = aligned(examples(1))
    start = round(whole.phones.spans[1].start_s * FRAME_RATE_HZ) - 2
    phones = Timeline((Span(0.0, 0.02, Unit("sil")), Span(0.02, 0.03, Unit("t"))))
    cut = slice(start, start + 3)
    seen = tuple(None if mask is None else mask[cut] for mask in whole.observations.observed)
    return AlignedUtterance(
        AudioVisualObservations(tuple(values[cut] for values in whole.observations.streams), seen), phones
    )


def speech_posteriors(chains: Any, one: AlignedUtterance) -> np.ndarray:
    """Return the posterior of each density of speech [shape=(T, G)] in a model of speech alone, by all of its paths.

    Its states are the joint ones, its emissions those of speech, its moves the coupled ones.
    """
    lattice, mixtures = build_lattice_utterance(chains, one).lattice, chains.groups[0].mixtures
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


def learned(before: Any, density: int, gamma: np.ndarray, x: np.ndarray, floor: np.ndarray):
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
    for part in np.flatnonzero(total > MIN_COMPONENT_FRAMES):
        means[part] = weight[:, part] @ x / total[part]
        variances[part] = np.maximum(weight[:, part] @ (x - means[part]) ** 2 / total[part], floor)
    return total / total.sum(), means, variances


@pytest.mark.long
def test_a_step_is_that_of_the_split_model() -> None:
    """Speech of the first stage and of other speakers: the same utterance, with weights 1 and 49."""
    chains, own = trained(), three_frames()
    other = replace(own, observations=own.observations.without_visual_streams())
    found = train_on_speech(chains, [own], [other], second_stage(2, 1, 49.0)).groups[0].mixtures
    gamma, x = 50 * speech_posteriors(chains, own), own.observations.streams[0]
    before, (floor, _) = chains.groups[0].mixtures, compute_variance_floors([own.observations])
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
    steps = Steps()
    own, others = aligned(examples(4)), speech_alone(examples(4, seed=9))
    train_on_speech(trained(kind), own, others, second_stage(4, 6, 0.5), steps)
    for _, run in groupby(steps, lambda step: step[0]):
        figures = [log_likelihood for _, log_likelihood in run]
        assert len(figures) > 2
        assert np.diff(figures).min() > -1e-3
        assert figures[1] > figures[0] + 0.1
    assert {mixtures[0] for mixtures, _ in steps} == ({2} if kind == "hmm" else {2, 4})


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
    twice = e_step(chains, [build_lattice_utterance(chains, one)] * 2)
    heavy = e_step(chains, [build_lattice_utterance(chains, one, 2.0)])
    assert heavy.frames == twice.frames
    assert heavy.log_likelihood == pytest.approx(twice.log_likelihood)
    assert heavy.transition_counts == pytest.approx(twice.transition_counts, abs=1e-5)
    for a, b in zip(heavy.emissions, twice.emissions, strict=True):
        assert a.occupancy == pytest.approx(b.occupancy, abs=1e-4)
        assert a.products[0] == pytest.approx(b.products[0], abs=1e-2)


def fitted(sentences: Sequence[Example], **options: object) -> tuple[Any, Any]:
    engine = engine_named("coupled", SMALL | options)
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


STATES, LAGGED = 3, ("p", "uw", "aa")
SEEN = np.array([(0.0, 0.0), (0.5, -2.0), (2.0, 1.0)])
"""Speech of every state of a phone lies elsewhere on a circle; what is seen is wider in the middle one."""


def lagged(count: int, lag: int, seed: int) -> list[AlignedUtterance]:
    """Sentences of ten phones; a state lasts 3 to 7 frames; what is seen is ``lag`` frames ahead of the speech."""
    made = []
    for number in range(count):
        draw = np.random.default_rng([seed, number])
        phones = draw.integers(1, 3, 10).cumsum() % 3  # none twice in a row
        frames = draw.integers(3, 8, (10, STATES))
        edges = (np.cumsum([0, *frames.sum(axis=1)]) / 100).tolist()
        spans = (Span(a, b, Unit(LAGGED[p])) for (a, b), p in zip(pairwise(edges), phones, strict=True))
        state = np.repeat(STATES * np.repeat(phones, STATES) + np.tile(np.arange(STATES), 10), frames.ravel())
        early = state[np.clip(np.arange(len(state)) + lag, 0, len(state) - 1)]
        lips = SEEN[early // STATES] * np.where(early % STATES == 1, 1.3, 1)[:, None]
        speech = 3 * np.stack([np.cos(state * 2 * np.pi / 9), np.sin(state * 2 * np.pi / 9)], axis=1)
        noisy = (values + draw.normal(0, size, values.shape) for values, size in ((speech, 0.6), (lips, 0.3)))
        streams = tuple(values.astype(np.float32) for values in noisy)
        made.append(AlignedUtterance(AudioVisualObservations(streams, (None, None)), Timeline(tuple(spans))))
    return made


@cache
def trained_on(lag: int, kind: str, limit: int | None = 1, **more: object) -> tuple[Chains, float]:
    """Return chains, and the correlation of the lips that they make from speech alone, as the paper converts."""
    of = structure(kind, (THREE,) if kind == MULTISTREAM else (THREE, THREE), STATES, limit, **more)
    *_, grown = grow_chains(of, ("speech", "seen"), lagged(20, lag, 0), (1, 1), (1.0, 1.0))
    held_out, full = lagged(8, lag, 1), grown.model.full_lattice
    lips = [convert(grown.model, one.observations, full, VITERBI, EXACT, 5)[0][0] for one in held_out]
    recorded = [one.observations.streams[1].astype(float) for one in held_out]
    return grown.model, float(correlate_pooled(lips, recorded).mean())


def lead_shares(chains: Chains, lag: int) -> np.ndarray:
    """Return the shares of frames in which the lips are a state behind, in step and a state ahead, by both streams."""
    shares = np.zeros(3)
    for one in lagged(20, lag, 0):
        inference = chains.infer(one.observations, build_lattice_utterance(chains, one).lattice)
        states, probability = inference.posteriors.joint
        shares += np.bincount(chains.transitions.product.lead[1][states] + 1, probability.sum(axis=0), 3)
    return shares / shares.sum()


@pytest.mark.parametrize("lag", [5, -5])
@pytest.mark.parametrize("more", [{}, {"moves_together": True}])
def test_with_a_lag_coupled_chains_win(lag, more):
    """The lips are a state ahead of the voice, or behind it: one chain cannot say so."""
    chains, acc = trained_on(lag, COUPLED, **more)
    assert acc > trained_on(lag, MULTISTREAM)[1] + 0.05
    behind, _, ahead = lead_shares(chains, lag)
    assert (ahead > behind) == (lag > 0)
    assert max(ahead, behind) > 0.2


def test_without_a_lag_chains_that_move_together_are_one_chain():
    """By Eq. 2 both move by chance, given the joint state before: a tenth of the frames is out of step for nothing."""
    alone, together, printed = (
        trained_on(0, MULTISTREAM),
        trained_on(0, COUPLED, moves_together=True),
        trained_on(0, COUPLED),
    )
    assert together[1] == pytest.approx(alone[1], abs=0.005)
    assert lead_shares(together[0], 0)[1] > 0.99
    assert lead_shares(printed[0], 0)[1] < 0.9
    assert printed[1] < alone[1] - 0.005


@pytest.mark.long
def test_factorial_chains_as_printed_may_be_apart_from_the_start():
    """Without a limit in Viterbi training, more joint states two states apart have densities of their own."""
    two_apart = []
    for start_limit in (1, 2):
        chains, _ = trained_on(8, FACTORIAL, None, start_limit=start_limit, unseen_loss=0.0)
        first, second = chains.transitions.own_density_states.T
        two_apart.append(np.count_nonzero((first // STATES == second // STATES) & (np.abs(first - second) == 2)))
    assert two_apart[1] > two_apart[0]
