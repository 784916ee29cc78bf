"""Conversion of a coupled model to and from arrays. The names of the arrays are the file format."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import StreamGroup
from lipmotion.engines.coupled.chains.lattice import FactorialProduct, FactorialTransitions
from lipmotion.engines.coupled.chains.model import Chains, VisualStream
from lipmotion.engines.coupled.chains.product import Grammar, Structure, Transitions, find_reachable
from lipmotion.engines.coupled.conversion import OFFSETS, RegressionInputs, VisualRegression
from lipmotion.engines.coupled.model import CoupledConfig, CoupledModel
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.motion.arrays import MOTION_ARRAYS, PHONE_SET, motion_from_arrays, motion_to_arrays
from lipmotion.motion.context_window import FEATURES, WINDOW, acoustic_context_from_arrays
from lipmotion.motion.predictors import list_predictor_arrays, predictor_from_arrays, predictor_to_arrays
from lipmotion.motion.space import check_poses, check_rest
from lipmotion.stats.bigram import check_sums_to_one
from lipmotion.stats.mixture import MIXTURES, mixtures_from_arrays
from lipmotion.storage.schema import (
    BELOW_ONE,
    LARGEST_MEAN,
    LARGEST_VARIANCE,
    POSITIVE,
    Arrays,
    ArraySpec,
    check_arrays,
    check_index,
    refuse_undeclared,
    select_arrays,
)
from lipmotion.units import UnitSet


def coupled_to_arrays(model: CoupledModel) -> dict[str, NDArray[Any]]:
    """Serialise a model: return its arrays by name. The configuration is not among them."""
    chains = model.chains
    product = chains.transitions.product
    arrays = motion_to_arrays(PHONE_SET, model.space, model.closure, model.prior) | {
        "gain": model.scaling,
        "rest": model.rest_pose,
        "streams": np.array(chains.streams),
    }
    for number, chain in enumerate(chains.structure.chains):
        arrays[f"chain_{number}/bigram"] = product.grammar.bigrams[number].astype(np.float32)
        arrays[f"chain_{number}/first"] = product.grammar.initial[number].astype(np.float32)
        arrays[f"chain_{number}/units"] = np.array(list(chain.unit_of_phone.items()))
        arrays[f"chain_{number}/advance"] = chains.transitions.advance[number]
        if isinstance(chains.transitions, Transitions):
            arrays[f"chain_{number}/rows"] = chains.transitions.rows[number].astype(np.int32)
    if isinstance(chains.transitions, FactorialTransitions):
        arrays["pairs"] = chains.transitions.own_density_states.astype(np.int32)
    for number, group in enumerate(chains.groups):
        arrays |= {
            f"group_{number}/streams": np.array(group.streams),
            f"group_{number}/weights": np.array(group.weights),
            f"group_{number}/tie": group.tie.astype(np.int32),
            f"group_{number}/log_weights": group.mixtures.log_weights,
            f"group_{number}/means": group.mixtures.means.astype(np.float16),
            f"group_{number}/variances": group.mixtures.variances.astype(np.float16),
        }
    for number, stream in enumerate(model.visual):
        arrays |= {
            f"visual_{number}/columns": stream.columns,
            f"visual_{number}/scale": np.stack([stream.mean, stream.deviation]),
        }
    if model.regression is not None:
        inputs, regressions = model.regression
        arrays |= {
            "around/window": np.stack([inputs.acoustic.mean, inputs.acoustic.scale]),
            "around/window_basis": inputs.acoustic.basis.astype(np.float16),
            "around/belief": inputs.posterior_basis.astype(np.float16),
            "around/mean": inputs.mean,
            "around/basis": inputs.basis.astype(np.float16),
        }
        for number, regression in enumerate(regressions):
            arrays |= {
                f"following_{number}/kind": regression.regression_of_state,
                f"following_{number}/coefficients": regression.coefficients.astype(np.float16),
                f"following_{number}/variances": regression.variances,
            }
    return arrays | predictor_to_arrays(model.encoding)


def coupled_from_arrays(arrays: Arrays, config: CoupledConfig) -> CoupledModel:
    """Deserialise a model. Raises ModelFormatError: an array is missing, not declared, misshapen or out of range."""
    try:
        _, space, closure, prior = motion_from_arrays(arrays, PHONE_SET.name)
        sets = []
        for place, unit_set in enumerate(config.chains.split()):
            pairs = check_arrays(select_arrays(arrays, f"chain_{place}/"), UNITS)["units"]
            sets.append(UnitSet(unit_set, dict(pairs.tolist())))
        structure = config.structure_with(tuple(sets))
        poses = check_arrays(arrays, POSES, Q=space.dimensions)
        streams = tuple(poses["streams"].tolist())
        visual_streams = range(len(streams) - 1)
        refuse_undeclared(
            arrays,
            MOTION_ARRAYS,
            POSES,
            list_predictor_arrays(arrays),
            PAIRS,
            (f"chain_{number}/{key}" for number in range(len(sets)) for key in UNITS | CHAIN | ROWS),
            (f"visual_{number}/{key}" for number in visual_streams for key in VISUAL),
            (f"following_{number}/{key}" for number in visual_streams for key in VISUAL_REGRESSION),
            (f"group_{number}/{key}" for number in range(len(streams)) for key in GROUP),
            (f"around/{key}" for key in REGRESSION_INPUTS),
        )
        if structure.state_counts[0] > (count := arrays["group_0/tie"].size):
            raise ValueError(f"{structure.state_counts[0]} states of the first chain, of {count} in all")
        transitions = _read_transitions(arrays, structure)
        visual = tuple(
            _read_visual_stream(select_arrays(arrays, f"visual_{number}/"), name, space.dimensions, config.dynamic)
            for number, name in enumerate(streams[1:])
        )
        chains = Chains(streams, transitions, _read_groups(arrays, transitions.product.chain_states.shape[1], visual))
        is_regressed = config.dynamic and config.acoustic_regression
        regression = _read_regression(arrays, structure, visual) if is_regressed else None
        encoding = predictor_from_arrays(arrays, space.dimensions)
        scaling, rest = poses["gain"], poses["rest"]
        model = CoupledModel(chains, space, visual, regression, scaling, rest, closure, prior, encoding)
        check_rest(model.rest_pose, model.pose_limits)
        check_poses(model.pose_limits, space, closure)
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
REGRESSION_INPUTS = {
    **WINDOW,
    "belief": ArraySpec(np.float32, "N B", -1.01, 1.01),
    "mean": ArraySpec(np.float32, "I", -LARGEST_MEAN, LARGEST_MEAN),
    "basis": ArraySpec(np.float32, "I F", -1.01, 1.01),
}
VISUAL_REGRESSION = {
    "kind": ArraySpec(np.intp, "N", 0, 1e6),
    "coefficients": ArraySpec(np.float32, "E F D"),
    "variances": ArraySpec(np.float32, "N D", POSITIVE, LARGEST_VARIANCE),
}
"""The arrays of a model: of its chains, visual streams, stream groups, and regressions of visual means."""


def _read_transitions(arrays: Arrays, structure: Structure) -> Transitions | FactorialTransitions:
    of_chains = [select_arrays(arrays, f"chain_{number}/") for number in range(len(structure.chains))]
    chains = [check_arrays(each, CHAIN, U=len(units)) for each, units in zip(of_chains, structure.units, strict=True)]
    for chain in chains:
        check_sums_to_one("first", chain["first"].sum(keepdims=True))
        check_sums_to_one("bigram", chain["bigram"].sum(axis=1))
    grammar = Grammar(tuple(chain["bigram"] for chain in chains), tuple(chain["first"] for chain in chains))
    advance = tuple(chain["advance"] for chain in chains)
    if structure.limit is None:
        first, second = advance
        own_density_states = check_arrays(arrays, PAIRS)["pairs"]
        for number, count in enumerate(structure.state_counts):
            if len(advance[number]) != count:
                raise ValueError(f"chain_{number}/advance of {len(advance[number])} states, required {count}")
            check_index(f"pairs of chain {number}", own_density_states[:, number], count)
        return FactorialTransitions(FactorialProduct(structure, grammar), (first, second), own_density_states)
    product = find_reachable(structure, grammar)
    rows = tuple(check_arrays(each, ROWS, J=len(product.joint_states))["rows"] for each in of_chains)
    for number, row in enumerate(rows):
        blocks = 1 << number if structure.moves_together else 1
        if len(advance[number]) % blocks:
            raise ValueError(f"chain_{number}/advance of {len(advance[number])} rows, required a multiple of {blocks}")
        check_index(f"chain_{number}/rows", row, len(advance[number]) // blocks)
    return Transitions(product, rows, advance)


def _read_visual_stream(arrays: Arrays, name: str, dimensions: int, dynamic: bool) -> VisualStream:
    columns = check_arrays(arrays, VISUAL)["columns"]
    check_index(f"columns of {name}", columns, dimensions)
    if len(set(columns.tolist())) < len(columns):
        raise ValueError(f"columns of {name} that repeat")
    mean, deviation = check_arrays(arrays, VISUAL, D=len(columns) * (3 if dynamic else 1))["scale"]
    if not (deviation > 0).all():
        raise ValueError(f"scale of {name} with deviations that are not more than 0")
    return VisualStream(name, columns, dynamic, mean, deviation)


def _read_groups(arrays: Arrays, joint_states: int, visual: tuple[VisualStream, ...]) -> tuple[StreamGroup, ...]:
    groups, widths = [], [FEATURES, *(len(stream.mean) for stream in visual)]
    for number in range(sum(key.endswith("/tie") for key in arrays)):
        of_group = select_arrays(arrays, f"group_{number}/")
        streams = tuple(check_arrays(of_group, {"streams": GROUP["streams"]})["streams"].tolist())
        check_index(f"group_{number}/streams", np.array(streams), len(widths))
        edges = np.cumsum([0, *(widths[stream] for stream in streams)]).tolist()
        checked = check_arrays(of_group, GROUP, J=joint_states, D=edges[-1])
        check_index(f"group_{number}/tie", checked["tie"], checked.sizes["G"])
        columns, weights = tuple(slice(a, b) for a, b in pairwise(edges)), tuple(checked["weights"].tolist())
        groups.append(StreamGroup(streams, columns, mixtures_from_arrays(checked), weights, checked["tie"]))
    if sorted(stream for group in groups for stream in group.streams) != list(range(len(widths))):
        raise ValueError("streams that are in no group, or in two")
    return tuple(groups)


def _read_regression(
    arrays: Arrays, structure: Structure, visual: tuple[VisualStream, ...]
) -> tuple[RegressionInputs, tuple[VisualRegression, ...]]:
    of_inputs = select_arrays(arrays, "around/")
    check_arrays(of_inputs, REGRESSION_INPUTS, N=structure.state_counts[0])
    size = of_inputs["window_basis"].shape[1] + of_inputs["belief"].shape[1] * len(OFFSETS)
    checked = check_arrays(of_inputs, REGRESSION_INPUTS, N=structure.state_counts[0], I=size)
    acoustic = acoustic_context_from_arrays(checked)
    inputs = RegressionInputs(acoustic, checked["belief"], checked["mean"], checked["basis"])
    regressions = []
    for number, stream in enumerate(visual):
        count = structure.state_counts[structure.chain_of(number + 1)]
        sizes = {"N": count, "F": checked.sizes["F"] + 1, "D": len(stream.mean)}
        stored = check_arrays(select_arrays(arrays, f"following_{number}/"), VISUAL_REGRESSION, **sizes)
        check_index(f"following_{number}/kind", stored["kind"], stored.sizes["E"])
        regressions.append(VisualRegression(stored["kind"], stored["coefficients"], stored["variances"]))
    return inputs, tuple(regressions)
