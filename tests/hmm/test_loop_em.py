import numpy as np
import pytest

from kernels.networks import phone_loop, random_network
from lipmotion.errors import InputError
from lipmotion.hmm import loop_em
from lipmotion.hmm.loop_em import em_step
from lipmotion.hmm.network import Network
from lipmotion.stats.mixture import Mixtures
from oracles import networks

FLOOR = np.full(2, 1e-3, np.float32)


def mixtures_of(seed: int, densities: int, components: int = 2) -> Mixtures:
    draw = np.random.default_rng([seed, 1])
    weights = draw.dirichlet(np.ones(components), densities)
    means, variances = draw.normal(0, 2, (densities, components, 2)), draw.uniform(0.5, 2, (densities, components, 2))
    return Mixtures(*(values.astype(np.float32) for values in (np.log(weights), means, variances)))


def recordings(seed: int, lengths) -> list[np.ndarray]:
    draw = np.random.default_rng([seed, 2])
    return [draw.normal(0, 2, (length, 2)).astype(np.float32) for length in lengths]


def by_hand(mixtures, arrays, arcs, data):
    """Sums over all paths and components: of arcs, of beginnings, and of components, features and squares."""
    G, M, D = mixtures.size
    sums, begun, total = np.zeros((G, M, 2 * D + 1)), np.zeros(len(arrays["emission"])), 0.0
    followed = dict.fromkeys(arcs, 0.0)
    ends = arrays["log_initial"].astype(float), arrays["log_final"].astype(float)
    exact = {arc: float(log) for arc, log in arcs.items()}
    for x in data:
        components = mixtures.log_components(x).astype(float)
        densities = np.logaddexp.reduce(components, axis=2)
        posterior, counts, log_likelihood = networks.posteriors(densities, arrays["emission"], exact, *ends)
        shares = np.exp(components - densities[:, :, None])
        for state, density in enumerate(arrays["emission"]):
            weights = posterior[:, state, None] * shares[:, density]
            sums[density] += weights.T @ np.concatenate([x, x * x, np.ones((len(x), 1))], axis=1)
        begun += posterior[0]
        followed = {arc: followed[arc] + counts[arc] for arc in followed}
        total += log_likelihood
    return sums, begun, followed, total


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("cells", [1, 1_000_000])
def test_a_step_is_that_of_all_paths(components, cells, monkeypatch):
    monkeypatch.setattr(loop_em, "CELLS", cells)
    arrays, arcs = random_network(2, states=4, densities=3, density_of_arcs=0.5)
    mixtures, data = mixtures_of(2, 3, components), recordings(2, [5, 3, 6, 5])
    sums, begun, followed, total = by_hand(mixtures, arrays, arcs, data)
    better, network, log_likelihood = em_step(mixtures, Network(**arrays), data, FLOOR)
    assert log_likelihood == pytest.approx(total / 19, rel=1e-5)
    with np.errstate(divide="ignore"):
        assert network.log_initial == pytest.approx(np.log(begun / begun.sum()), abs=1e-4)
    for source in range(4):
        mine = {target: count for (s, target), count in followed.items() if s == source}
        before = sum(np.exp(float(arcs[source, target])) for target in mine)
        for target, count in mine.items():
            arc = sorted(arcs, key=lambda arc: arc[1]).index((source, target))
            if sum(mine.values()) >= loop_em.LEAST_FRAMES:
                assert np.exp(network.arc_log[arc]) == pytest.approx(count / sum(mine.values()) * before, abs=1e-4)
            else:
                assert network.arc_log[arc] == arrays["arc_log"][arc]
    for density in range(3):
        wanted = mixtures.copy()
        count, (first, second) = sums[density, :, -1], np.split(sums[density, :, :-1], 2, axis=1)
        if count.sum() >= loop_em.LEAST_FRAMES:
            wanted.estimate(np.array([density]), count[None], first[None], second[None], FLOOR)
        assert better.means[density] == pytest.approx(wanted.means[density], abs=1e-4)
        assert better.variances[density] == pytest.approx(wanted.variances[density], abs=1e-3)
        assert np.exp(better.log_weights[density]) == pytest.approx(np.exp(wanted.log_weights[density]), abs=1e-4)


@pytest.mark.parametrize("tied", [False, True])
def test_no_step_lowers_the_likelihood(tied):
    arrays, _ = phone_loop(1, units=9, states=2)
    states = len(arrays["emission"])
    if tied:
        arrays["emission"] = np.arange(states) // 2
    arrays["log_final"] -= 1
    leaving = np.bincount(arrays["arc_from"], np.exp(arrays["arc_log"].astype(float)))
    arrays["arc_log"] = (arrays["arc_log"] - np.log(leaving)[arrays["arc_from"]]).astype(np.float32)
    mixtures, network = mixtures_of(1, int(arrays["emission"].max()) + 1, 1), Network(**arrays)
    data = recordings(1, [60, 80, 100, 40])
    likelihoods = []
    for _ in range(12):
        mixtures, network, log_likelihood = em_step(mixtures, network, data, FLOOR)
        likelihoods.append(log_likelihood)
    assert (np.diff(likelihoods) > -1e-4).all()
    assert likelihoods[-1] > likelihoods[0] + 0.1


def test_shared_work_gives_the_same_bits():
    arrays, _ = phone_loop(2)
    mixtures, data = mixtures_of(2, len(arrays["emission"])), recordings(2, [30, 40, 50])
    alone = em_step(mixtures, Network(**arrays), data, FLOOR)
    shared = em_step(mixtures, Network(**arrays), data, FLOOR, lambda function, jobs: map(function, list(jobs)))
    assert np.array_equal(alone[0].means, shared[0].means)
    assert np.array_equal(alone[1].arc_log, shared[1].arc_log)


def test_a_recording_without_a_path_is_left_out():
    arrays, _ = random_network(4, states=2, densities=2, density_of_arcs=0.0)
    arrays |= {"log_initial": np.array([0, -np.inf], np.float32), "log_final": np.array([-np.inf, 0], np.float32)}
    arrays |= {"arc_from": np.array([0, 0, 1]), "arc_start": np.array([0, 1]), "arc_log": np.full(3, -0.7, np.float32)}
    mixtures, data = mixtures_of(4, 2), recordings(4, [1, 9])
    both = em_step(mixtures, Network(**arrays), data, FLOOR)
    alone = em_step(mixtures, Network(**arrays), data[1:], FLOOR)
    assert both[2] == pytest.approx(alone[2], rel=1e-6)
    assert both[0].means == pytest.approx(alone[0].means, abs=1e-5)
    with pytest.raises(InputError, match="none of 1 recordings"):
        em_step(mixtures, Network(**arrays), data[:1], FLOOR)


@pytest.mark.parametrize(
    ("data", "floor", "message"),
    [
        ([np.ones((4, 3), np.float32)], FLOOR, "recording 0 has shape"),
        ([np.ones((4, 2), np.float32), np.ones((0, 2), np.float32)], FLOOR, "recording 1 has shape"),
        ([np.ones((4, 2), np.float32)], np.zeros(2, np.float32), "floor"),
        ([np.ones((4, 2), np.float32)], np.ones(3, np.float32), "floor"),
    ],
)
def test_wrong_input_is_refused(data, floor, message):
    arrays, _ = phone_loop(3)
    with pytest.raises(InputError, match=message):
        em_step(mixtures_of(3, len(arrays["emission"])), Network(**arrays), data, floor)
