"""A coupled model as plain arrays."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Group
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.product import Grammar, reachable
from lipmotion.engines.coupled.chains.structures import FACTORIAL, Structure
from lipmotion.engines.coupled.chains.transitions import Transitions
from lipmotion.engines.coupled.chains.unlimited import FreeProduct, FreeTransitions
from lipmotion.engines.coupled.chains.visual_streams import VisualStream
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.conversion.regression import OFFSETS, Following, Surroundings
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.motion.arrays import MOTION_ARRAYS, PHONE_SET, motion_arrays, motion_from_arrays
from lipmotion.motion.context_window import FEATURES, WINDOW, acoustic_context_from
from lipmotion.motion.limits import check_poses, check_rest
from lipmotion.stats.bigram import check_sums_to_one
from lipmotion.stats.mixture import MIXTURES, mixtures_from_arrays
from lipmotion.storage.schema import (
    BELOW_ONE,
    LARGEST_VARIANCE,
    POSITIVE,
    STANDARD,
    Arrays,
    ArraySpec,
    arrays_under,
    check_index,
    checked_arrays,
    refuse_undeclared,
)
from lipmotion.units import UnitSet


def coupled_arrays(model: CoupledModel) -> dict[str, NDArray[Any]]:
    """Return a model as arrays; its configuration is not among them."""
    chains = model.chains
    product = chains.transitions.product
    arrays = motion_arrays(PHONE_SET, model.space, model.closure) | {
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
    """Return the model again. Raises ModelFormatError: something is missing, out of place or out of range."""
    try:
        _, space, closure = motion_from_arrays(arrays, PHONE_SET.name)
        structure = _structure(arrays, config)
        poses = checked_arrays(arrays, POSES, Q=space.dimensions)
        streams = tuple(poses["streams"].tolist())
        _check_names(arrays, structure, len(streams))
        if structure.counts[0] > arrays["group_0/tie"].size:
            raise ValueError(f"{structure.counts[0]} states of the first chain, of {arrays['group_0/tie'].size} in all")
        transitions = _transitions(arrays, structure)
        visual = tuple(
            _visual(arrays_under(arrays, f"visual_{number}/"), name, space.dimensions, config.dynamic)
            for number, name in enumerate(streams[1:])
        )
        chains = Chains(streams, transitions, _groups(arrays, transitions.product.chain_states.shape[1], visual))
        follow = _follow(arrays, structure, visual) if config.dynamic and config.acoustic_regression else None
        model = CoupledModel(chains, space, visual, follow, poses["gain"], poses["rest"], closure)
        check_rest(model.rest, model.poses)
        check_poses(model.poses, space, closure)
        return model
    except (KeyError, ValueError, TypeError, IndexError, OverflowError, InputError) as error:
        raise ModelFormatError(f"the coupled model is damaged ({error}); train or download it again") from error


POSES = {
    "gain": ArraySpec(np.float64, "Q", POSITIVE, 10),
    "rest": ArraySpec(np.float64, "Q", -1e6, 1e6),
    "streams": ArraySpec(np.str_, "S"),
}
UNITS = {"units": ArraySpec(np.str_, "N 2")}
CHAIN = {
    "bigram": ArraySpec(np.float64, "U U", POSITIVE, 1.1),
    "first": ArraySpec(np.float64, "U", POSITIVE, 1.1),
    "advance": ArraySpec(np.float64, "R", POSITIVE, BELOW_ONE),
}
ROWS = {"rows": ArraySpec(np.intp, "J", 0, 1e9)}
PAIRS = {"pairs": ArraySpec(np.intp, "p 2", 0, 1e9)}
VISUAL = {"columns": ArraySpec(np.intp, "C", 0, 1e6), "scale": ArraySpec(np.float64, "2 D", -1e6, 1e6)}
GROUP = {
    **MIXTURES,
    "streams": ArraySpec(np.intp, "S", 0, 1e6),
    "weights": ArraySpec(np.float64, "S", 0, 1e6, whole=True),
    "tie": ArraySpec(np.intp, "J", 0, 1e9),
}
AROUND = {
    **WINDOW,
    "belief": ArraySpec(np.float32, "N B", -1.01, 1.01),
    "mean": ArraySpec(np.float32, "I", -STANDARD, STANDARD),
    "basis": ArraySpec(np.float32, "I F", -1.01, 1.01),
}
FOLLOWING = {
    "kind": ArraySpec(np.intp, "N", 0, 1e6),
    "coefficients": ArraySpec(np.float32, "E F D"),
    "variances": ArraySpec(np.float32, "N D", POSITIVE, LARGEST_VARIANCE),
}
"""How a model is stored: its chains, streams, groups of them, and what visual means follow."""


def _check_names(arrays: Arrays, structure: Structure, streams: int) -> None:
    """Raise ValueError where there is an array that nothing declares."""
    chain = (f"chain_{number}/{key}" for number in range(len(structure.chains)) for key in UNITS | CHAIN | ROWS)
    seen = (
        f"{part}_{number}/{key}"
        for part, table in (("visual", VISUAL), ("following", FOLLOWING))
        for number in range(streams - 1)
        for key in table
    )
    group = (f"group_{number}/{key}" for number in range(streams) for key in GROUP)
    refuse_undeclared(arrays, MOTION_ARRAYS, POSES, PAIRS, chain, seen, group, (f"around/{key}" for key in AROUND))


def _structure(arrays: Arrays, config: CoupledConfig) -> Structure:
    sets = []
    for number, name in enumerate(config.chains.split()):
        pairs = checked_arrays(arrays_under(arrays, f"chain_{number}/"), UNITS)["units"]
        sets.append(UnitSet(name, dict(pairs.tolist())))
    limit = None if config.asynchrony < 0 else config.asynchrony
    return Structure(config.structure, tuple(sets), config.states, limit, config.cross_units)


def _transitions(arrays: Arrays, structure: Structure) -> Transitions | FreeTransitions:
    mine = [arrays_under(arrays, f"chain_{number}/") for number in range(len(structure.chains))]
    found = [checked_arrays(own, CHAIN, U=len(units)) for own, units in zip(mine, structure.units, strict=True)]
    for each in found:
        check_sums_to_one("first", each["first"].sum(keepdims=True))
        check_sums_to_one("bigram", each["bigram"].sum(axis=1))
    grammar = Grammar(tuple(each["bigram"] for each in found), tuple(each["first"] for each in found))
    advance = tuple(each["advance"] for each in found)
    if structure.kind == FACTORIAL and structure.limit is None and len(found) == 2:
        first, second = advance
        pairs = checked_arrays(arrays, PAIRS)["pairs"]
        for chain, count in enumerate(structure.counts):
            if len(advance[chain]) != count:
                raise ValueError(f"chain_{chain}/advance of {len(advance[chain])} states, required {count}")
            check_index(f"pairs of chain {chain}", pairs[:, chain], count)
        return FreeTransitions(FreeProduct(structure, grammar), (first, second), pairs)
    product = reachable(structure, grammar)
    rows = tuple(checked_arrays(own, ROWS, J=len(product.joints))["rows"] for own in mine)
    for chain, row in enumerate(rows):
        check_index(f"chain_{chain}/rows", row, len(advance[chain]))
    return Transitions(product, rows, advance)


def _visual(arrays: Arrays, name: str, dimensions: int, dynamic: bool) -> VisualStream:
    columns = checked_arrays(arrays, VISUAL)["columns"]
    check_index(f"columns of {name}", columns, dimensions)
    if len(set(columns.tolist())) < len(columns):
        raise ValueError(f"columns of {name} that repeat")
    mean, deviation = checked_arrays(arrays, VISUAL, D=len(columns) * (3 if dynamic else 1))["scale"]
    if not (deviation > 0).all():
        raise ValueError(f"scale of {name} with deviations that are not more than 0")
    return VisualStream(name, columns, dynamic, mean, deviation)


def _groups(arrays: Arrays, states: int, visual: tuple[VisualStream, ...]) -> tuple[Group, ...]:
    groups, widths = [], [FEATURES, *(len(stream.mean) for stream in visual)]
    for number in range(sum(key.endswith("/tie") for key in arrays)):
        mine = arrays_under(arrays, f"group_{number}/")
        streams = tuple(checked_arrays(mine, {"streams": GROUP["streams"]})["streams"].tolist())
        check_index(f"group_{number}/streams", np.array(streams), len(widths))
        edges = np.cumsum([0, *(widths[stream] for stream in streams)]).tolist()
        found = checked_arrays(mine, GROUP, J=states, D=edges[-1])
        check_index(f"group_{number}/tie", found["tie"], found.sizes["G"])
        columns, weights = tuple(slice(a, b) for a, b in pairwise(edges)), tuple(found["weights"].tolist())
        groups.append(Group(streams, columns, mixtures_from_arrays(found), weights, found["tie"]))
    if sorted(stream for group in groups for stream in group.streams) != list(range(len(widths))):
        raise ValueError("streams that no group has, or two")
    return tuple(groups)


def _follow(
    arrays: Arrays, structure: Structure, visual: tuple[VisualStream, ...]
) -> tuple[Surroundings, tuple[Following, ...]]:
    mine = arrays_under(arrays, "around/")
    checked_arrays(mine, AROUND, N=structure.counts[0])
    axes = mine["window_basis"].shape[1] + mine["belief"].shape[1] * len(OFFSETS)
    found = checked_arrays(mine, AROUND, N=structure.counts[0], I=axes)
    around = Surroundings(acoustic_context_from(found), found["belief"], found["mean"], found["basis"])
    following = []
    for number, stream in enumerate(visual):
        count = structure.counts[structure.chain_of(number + 1)]
        sizes = {"N": count, "F": found.sizes["F"] + 1, "D": len(stream.mean)}
        own = checked_arrays(arrays_under(arrays, f"following_{number}/"), FOLLOWING, **sizes)
        check_index(f"following_{number}/kind", own["kind"], own.sizes["E"])
        following.append(Following(own["kind"], own["coefficients"], own["variances"]))
    return around, tuple(following)
