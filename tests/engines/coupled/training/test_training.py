from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from engines.coupled.tiny import THREE, TWO, chains, observations, structure
from lipmotion import engines, errors
from lipmotion.engines.coupled.chains.densities import AudioVisualObservations, reestimated_group
from lipmotion.engines.coupled.chains.lattice import FactorialTransitions
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM, SYSTEMS
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.model import CoupledConfig
from lipmotion.engines.coupled.training import alignment, coupled_training
from lipmotion.engines.coupled.training import chain_training as em_steps
from lipmotion.engines.coupled.training.chain_training import CONVERGENCE_GAIN, MixtureSchedule, growing_chains
from lipmotion.motion.frame_labels import frames_away
from lipmotion.testing.examples import examples
from lipmotion.types import GREY, Channel, Example, Span, Timeline, Unit, silent_monitor
from oracles import coupled as oracle

FLOORS = (np.full(2, 1e-3, np.float32), np.full(1, 1e-3, np.float32))
PHONES = ("p", "uw", "aa", "b", "aa", "uw")


def sentences(count=6, frames_each=9, seed=0) -> list[alignment.AlignedUtterance]:
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
        made.append(alignment.AlignedUtterance(streams, Timeline(spans)))
    return made


@pytest.mark.parametrize(
    ("kind", "sets"), [(COUPLED, (THREE, TWO)), (FACTORIAL, (THREE, TWO)), (MULTISTREAM, (THREE,)), (HMM, (THREE,))]
)
def test_the_likelihood_rises_at_every_step(kind, sets):
    steps = []
    how = MixtureSchedule((4,) if kind == HMM else (4, 2), (1.0, 1.0), most_steps=8)
    of = structure(kind, sets, states=3)
    *_, grown = growing_chains(of, ("speech", "seen"), sentences(), how, steps.append)
    assert grown.converged is bool(steps[-1].log_likelihood - steps[-2].log_likelihood < CONVERGENCE_GAIN)
    assert {step.mixtures[0] for step in steps} == {1, 2, 4}
    for one, other in pairwise(steps):
        if one.mixtures == other.mixtures:
            assert other.log_likelihood >= one.log_likelihood - 1e-5


def test_densities_are_weighted_means_and_variances():
    """Eqs. A.12 to A.15 of Xie & Liu 2007, by enumeration of paths and components."""
    model = chains()
    data = [observations(4, seed=1), observations(4, seed=2)]
    statistics = em_steps.e_step(model, [em_steps.LatticeUtterance(one, model.full_lattice) for one in data])
    joints = [oracle.posteriors(model, one)[0] for one in data]
    compared = 0
    for stream, (group, own) in enumerate(zip(model.groups, statistics.emissions, strict=True)):
        better = reestimated_group(group, own, [np.float32([1e-6])], 0.0, (0, 1)).mixtures
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


def test_a_stream_that_was_not_observed_is_not_reestimated():
    model = chains()
    blind = observations(8, seen=False)
    statistics = em_steps.e_step(model, [em_steps.LatticeUtterance(blind, model.full_lattice)])
    assert not statistics.emissions[1].products[0].any()
    better = em_steps.m_step(model, statistics, FLOORS, streams=(0, 1))
    np.testing.assert_array_equal(better.groups[1].mixtures.means, model.groups[1].mixtures.means)
    assert not np.array_equal(better.groups[0].mixtures.means, model.groups[0].mixtures.means)


def test_no_recording_has_a_path_and_options_that_cannot_be():
    model = chains()
    lattice = replace(model.full_lattice, allowed_units=np.zeros((3, 3), bool))
    with pytest.raises(errors.InputError, match="labels"):
        em_steps.e_step(model, [em_steps.LatticeUtterance(observations(3), lattice)])
    for options in ({"mixtures": 3}, {"asynchrony": -2}, {"structure": "ring"}, {"audio_weight": -1.0}):
        with pytest.raises(errors.InputError):
            CoupledConfig(**options)


def test_allowed_units_are_those_of_labels_near_a_frame():
    of = structure()
    phones = Timeline((Span(0.0, 0.2, Unit("p")), Span(0.2, 0.4, Unit("aa"))))
    allowed = alignment.allowed_units(of, phones, 60)
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
    path = alignment.uniform_path(product, Timeline((Span(0.0, 0.06, Unit("uw")), Span(0.06, 0.09, Unit("p")))), 9)
    states = [product.joint_states[s].states for s in path]
    assert states == [(0, 0), (0, 0), (1, 1), (1, 1), (2, 2), (2, 2), (0, 0), (1, 1), (2, 2)]


def test_floors_are_of_observed_frames():
    seen = np.arange(40) < 20
    values = np.where(seen, np.tile([0.0, 2.0], 20), 1e6)[:, None].astype(np.float32)
    data = AudioVisualObservations((np.zeros((40, 2), np.float32), values), (None, seen))
    assert em_steps.variance_floors([data])[1] == pytest.approx(0.01)


def test_frames_away_from_speech_are_silence():
    units = Timeline((Span(0.0, 0.5, Unit("sil")), Span(0.5, 0.7, Unit("aa")), Span(0.7, 1.5, Unit("sil"))))
    away = frames_away(units, 151, 0.45)
    assert away[:4].all()
    assert not away[6:114].any()
    assert away[116:].all()


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
    config = CoupledConfig(chains="phone viseme viseme", states=2, mixtures=1, visual_weight=0.5, eigenlips_weight=0.25)
    model = coupled_training.fit_coupled(data, config, silent_monitor).model
    assert model.chains.streams == ("speech", "geometry", "eigenlips")
    assert [group.weights for group in model.chains.groups] == [(1.0,), (0.5,), (0.25,)]
    assert [stream.name for stream in model.visual] == ["geometry", "eigenlips"]
    assert len(model.chains.structure.chains) == 3
    generated = CoupledEngine(config).generate(model, data[0].speech).motion
    for name in ("opening", "lips_r_01"):
        assert np.corrcoef(generated[name], data[0].motion[name])[0, 1] > 0.8


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * ("FHMM" in name)) for name in SYSTEMS])
def test_a_preset_is_the_system_of_the_paper(name):
    """Table 2: 47 phones, or 13 visemes, of five states; 39 features of speech; eigenlips; streams of equal weight."""
    data = [with_pictures(number) for number in range(2)]
    lips = [replace(one, motion=one.motion.selected(["lips_r_01"])) for one in data]
    chains = engines.engine_from_settings(preset=f"xieliu2007 {name}").fit(lips, silent_monitor).model.chains
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
