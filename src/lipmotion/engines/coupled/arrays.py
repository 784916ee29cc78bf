"""A coupled model as plain arrays."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.densities import Group
from lipmotion.engines.coupled.following import OFFSETS, Following, Surroundings
from lipmotion.engines.coupled.free import FreeProduct, FreeTransitions
from lipmotion.engines.coupled.learned import CoupledModel
from lipmotion.engines.coupled.model import Chains
from lipmotion.engines.coupled.product import Grammar, reachable
from lipmotion.engines.coupled.systems import FACTORIAL, Structure
from lipmotion.engines.coupled.transitions import Transitions
from lipmotion.engines.coupled.visual import VisualStream
from lipmotion.engines.trajectory.frame import SINGLE, frame_arrays, frame_from_arrays
from lipmotion.engines.trajectory.window import AudioWindow
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.stats.mixture import Mixtures
from lipmotion.units import UnitSet

Arrays = Mapping[str, NDArray[Any]]


def coupled_arrays(model: CoupledModel) -> dict[str, NDArray[Any]]:
    """Return a model as arrays; its configuration is not among them."""
    chains = model.chains
    product = chains.transitions.product
    arrays = frame_arrays(SINGLE, model.space, model.closure) | {
        "gain": model.gain,
        "rest": model.rest,
        "streams": np.array(chains.streams),
    }
    for number, chain in enumerate(chains.structure.chains):
        arrays[f"chain_{number}/bigram"] = product.grammar.bigrams[number].astype(np.float32)
        arrays[f"chain_{number}/first"] = product.grammar.firsts[number].astype(np.float32)
        arrays[f"chain_{number}/units"] = np.array(list(chain.of.items()))
        arrays[f"chain_{number}/advance"] = chains.transitions.advance[number]
        if isinstance(chains.transitions, Transitions):
            arrays[f"chain_{number}/rows"] = chains.transitions.rows[number].astype(np.int32)
    if isinstance(chains.transitions, FreeTransitions):
        arrays["pairs"] = chains.transitions.pairs.astype(np.int32)
    for number, group in enumerate(chains.groups):
        arrays |= {f"group_{number}/{key}": array for key, array in _group_arrays(group).items()}
    for number, stream in enumerate(model.visual):
        arrays |= {
            f"visual_{number}/columns": stream.columns,
            f"visual_{number}/scale": np.stack([stream.mean, stream.deviation]),
        }
    return arrays | _follow_arrays(model)


def _group_arrays(group: Group) -> dict[str, NDArray[Any]]:
    return {
        "streams": np.array(group.streams),
        "weights": np.array(group.weights),
        "tie": group.tie.astype(np.int32),
        "log_weights": group.mixtures.log_weights,
        "means": group.mixtures.means.astype(np.float16),
        "variances": group.mixtures.variances.astype(np.float16),
    }


def _follow_arrays(model: CoupledModel) -> dict[str, NDArray[Any]]:
    if model.follow is None:
        return {}
    around, following = model.follow
    arrays: dict[str, NDArray[Any]] = {
        "around/window": np.stack([around.sound.mean, around.sound.scale]),
        "around/window_basis": around.sound.basis.astype(np.float16),
        "around/belief": around.belief.astype(np.float16),
        "around/mean": around.mean,
        "around/basis": around.basis.astype(np.float16),
    }
    for number, one in enumerate(following):
        arrays |= {
            f"following_{number}/kind": one.kind,
            f"following_{number}/coefficients": one.coefficients.astype(np.float16),
            f"following_{number}/variances": one.variances,
        }
    return arrays


def coupled_from_arrays(arrays: Arrays, config: CoupledConfig) -> CoupledModel:
    """Return the model again. Raises ModelFormatError: something is missing, has the wrong shape or is no number."""
    try:
        _, space, closure = frame_from_arrays(arrays, SINGLE.name)
        structure = _structure(arrays, config)
        transitions = _transitions(arrays, structure)
        streams = tuple(map(str, arrays["streams"]))
        _check(arrays, {"gain": (space.dimensions,), "rest": (space.dimensions,)})
        visual = tuple(
            _visual(arrays, number, name, space.dimensions, config.dynamic) for number, name in enumerate(streams[1:])
        )
        widths = [39, *(len(stream.mean) for stream in visual)]
        groups = tuple(_groups(arrays, transitions.product.chain_states.shape[1], widths))
        if sorted(stream for group in groups for stream in group.streams) != list(range(len(streams))):
            raise ValueError("streams that no group has, or two")
        chains = Chains(streams, transitions, groups)
        follow = _follow(arrays, structure, visual) if config.dynamic and config.follows else None
        gain, rest = arrays["gain"].astype(float), arrays["rest"].astype(float)
        return CoupledModel(chains, space, visual, follow, gain, rest, closure)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError, InputError) as error:
        raise ModelFormatError(f"the coupled model is damaged ({error}); train or download it again") from error


def _structure(arrays: Arrays, config: CoupledConfig) -> Structure:
    sets = []
    for number, name in enumerate(config.chains.split()):
        pairs = arrays[f"chain_{number}/units"]
        sets.append(UnitSet(name, {str(phone): str(unit) for phone, unit in pairs}))
    limit = None if config.asynchrony < 0 else config.asynchrony
    return Structure(config.structure, tuple(sets), config.states, limit, config.crosses)


def _transitions(arrays: Arrays, structure: Structure) -> Transitions | FreeTransitions:
    chains = range(len(structure.chains))
    grammar = _grammar(arrays, structure)
    advance = tuple(_probabilities(arrays[f"chain_{chain}/advance"]) for chain in chains)
    if structure.kind == FACTORIAL and structure.limit is None and len(chains) == 2:
        first, second = advance
        _check(arrays, {f"chain_{chain}/advance": (structure.counts[chain],) for chain in chains})
        pairs = arrays["pairs"].astype(np.intp)
        for chain, count in enumerate(structure.counts):
            _within(pairs[:, chain], count)
        return FreeTransitions(FreeProduct(structure, grammar), (first, second), pairs)
    product = reachable(structure, grammar)
    return Transitions(product, tuple(_rows(arrays, chain, len(product.joints)) for chain in chains), advance)


def _grammar(arrays: Arrays, structure: Structure) -> Grammar:
    bigrams, firsts = [], []
    for chain, units in enumerate(structure.units):
        bigram, first = arrays[f"chain_{chain}/bigram"], arrays[f"chain_{chain}/first"]
        _check(arrays, {f"chain_{chain}/bigram": (len(units), len(units)), f"chain_{chain}/first": (len(units),)})
        if not (bigram > 0).all() or not (first > 0).all():
            raise ValueError("probabilities that are not more than 0")
        bigrams.append(bigram.astype(float))
        firsts.append(first.astype(float))
    return Grammar(tuple(bigrams), tuple(firsts))


def _rows(arrays: Arrays, chain: int, count: int) -> NDArray[np.intp]:
    _check(arrays, {f"chain_{chain}/rows": (count,)})
    return _within(arrays[f"chain_{chain}/rows"], len(arrays[f"chain_{chain}/advance"]))


def _within(numbers: NDArray[Any], count: int) -> NDArray[np.intp]:
    if len(numbers) and not 0 <= numbers.min() <= numbers.max() < count:
        raise ValueError(f"a number {numbers.max()}, required under {count}")
    return numbers.astype(np.intp)


def _probabilities(values: NDArray[Any]) -> NDArray[np.float64]:
    if not ((values > 0) & (values < 1)).all():
        raise ValueError("probabilities that are not between 0 and 1")
    return values.astype(float)


def _visual(arrays: Arrays, number: int, name: str, dimensions: int, dynamic: bool) -> VisualStream:
    columns = _within(arrays[f"visual_{number}/columns"], dimensions)
    size = len(columns) * (3 if dynamic else 1)
    _check(arrays, {f"visual_{number}/scale": (2, size)})
    mean, deviation = arrays[f"visual_{number}/scale"].astype(float)
    if not (deviation > 0).all():
        raise ValueError("deviations that are not more than 0")
    return VisualStream(name, columns, dynamic, mean, deviation)


def _groups(arrays: Arrays, states: int, widths: list[int]) -> list[Group]:
    groups = []
    for number in range(sum(key.endswith("/tie") for key in arrays)):
        mine = {key.partition("/")[2]: array for key, array in arrays.items() if key.startswith(f"group_{number}/")}
        streams = tuple(_within(mine["streams"], len(widths)).tolist())
        edges = np.cumsum([0, *(widths[stream] for stream in streams)]).tolist()
        shape = (*mine["log_weights"].shape, edges[-1])
        _check(mine, {"tie": (states,), "means": shape, "variances": shape, "weights": (len(streams),)})
        if not (mine["variances"] > 0).all() or not np.isfinite(mine["log_weights"].max(axis=1)).all():
            raise ValueError("variances that are not more than 0, or a density without a Gaussian")
        mixtures = Mixtures(*(mine[key].astype(np.float32) for key in ("log_weights", "means", "variances")))
        columns = tuple(slice(a, b) for a, b in pairwise(edges))
        tie = _within(mine["tie"], shape[0])
        groups.append(Group(streams, columns, mixtures, tuple(mine["weights"].astype(float).tolist()), tie))
    return groups


def _follow(
    arrays: Arrays, structure: Structure, visual: tuple[VisualStream, ...]
) -> tuple[Surroundings, tuple[Following, ...]]:
    inputs, sound_axes = arrays["around/window_basis"].shape
    belief_axes = arrays["around/belief"].shape[1]
    axes = arrays["around/basis"].shape[1]
    total = sound_axes + belief_axes * len(OFFSETS)
    _check(arrays, {"around/window": (2, inputs), "around/mean": (total,), "around/basis": (total, axes)})
    _check(arrays, {"around/belief": (structure.counts[0], belief_axes), "around/window_basis": (inputs, sound_axes)})
    mean, scale = arrays["around/window"].astype(np.float32)
    if not (scale > 0).all():
        raise ValueError("features of no spread")
    around = Surroundings(
        AudioWindow(mean, scale, arrays["around/window_basis"].astype(np.float32)),
        *(arrays[f"around/{key}"].astype(np.float32) for key in ("belief", "mean", "basis")),
    )
    found = []
    for number, stream in enumerate(visual):
        mine = {key.partition("/")[2]: array for key, array in arrays.items() if key.startswith(f"following_{number}/")}
        size, count = len(stream.mean), structure.counts[structure.chain_of(number + 1)]
        _check(mine, {"kind": (count,), "variances": (count, size)})
        _check(mine, {"coefficients": (len(mine["coefficients"]), axes + 1, size)})
        if not (mine["variances"] > 0).all():
            raise ValueError("variances that are not more than 0")
        kind = _within(mine["kind"], len(mine["coefficients"]))
        found.append(Following(kind, mine["coefficients"].astype(np.float32), mine["variances"].astype(np.float32)))
    return around, tuple(found)


def _check(arrays: Arrays, shapes: Mapping[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} of shape {arrays[name].shape}, required {shape}")
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} holds values that are not finite")
