"""Chains small enough to list all of their paths."""

from itertools import pairwise, product

import numpy as np

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations, StreamGroup
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.product import (
    Grammar,
    JointState,
    Product,
    Structure,
    create_transitions,
    find_reachable,
)
from lipmotion.units import PHONES, UnitSet
from oracles.statistics import random_mixtures

COUPLED, FACTORIAL, MULTISTREAM, HMM = "coupled", "factorial", "multistream", "hmm"
"""Values of the option ``structure``."""
SYSTEMS = ("ph-HMM", "ph-MSHMM", "ph-CHMM", "ph-FHMM", "ph-vi-CHMM", "ph-vi-FHMM")  # presets
BILABIAL = ("p", "b", "m", "em")
SHUT = (*BILABIAL, "sil", "sp")
THREE = UnitSet(
    "three",
    {phone: "closed" if phone in SHUT else "round" if phone in ("uw", "ow", "w") else "open" for phone in PHONES},
)
TWO = UnitSet("two", {phone: "closed" if phone in SHUT else "open" for phone in PHONES})
"""On the second chain, round and open are one unit."""
KINDS = [
    (COUPLED, (THREE, TWO), 1), (COUPLED, (THREE, TWO), 0), (FACTORIAL, (THREE, TWO), 1),
    (FACTORIAL, (THREE, TWO), None), (MULTISTREAM, (THREE,), 1), (HMM, (THREE,), 1),
]  # fmt: skip
"""Structures, the unit sets of their chains, and their limits of asynchrony."""


def structure(kind=COUPLED, chains=(THREE, TWO), states=2, limit=1, **more) -> Structure:
    return Structure(kind, chains, states, limit, **more)


def grammar(of: Structure, seed=0) -> Grammar:
    draw = np.random.default_rng(seed)
    counts = [len(units) for units in of.units]
    return Grammar(
        tuple(draw.dirichlet(np.ones(count), count) for count in counts),
        tuple(draw.dirichlet(np.ones(count)) for count in counts),
    )


def joint_product(of: Structure, seed=0) -> Product:
    """The product of chains; without a limit of asynchrony all of their joint states, each chain on its own."""
    own = grammar(of, seed)
    if of.limit is not None:
        return find_reachable(of, own)
    steps = [(np.eye(count), np.eye(count, k=1)) for count in of.state_counts]
    for bigram, (_, moving) in zip(own.bigrams, steps, strict=True):
        moving[of.states - 1 :: of.states] = 0
        moving[of.states - 1 :: of.states, :: of.states] = bigram
    tables = {moves: np.kron(steps[0][moves[0]], steps[1][moves[1]]) for moves in product((0, 1), repeat=2)}
    places = [(to, source, moves) for moves, table in tables.items() for source, to in np.argwhere(table)]
    targets, sources, moved = (np.array(part) for part in zip(*sorted(places), strict=True))
    share = np.array([tables[moves][source, to] for to, source, moves in sorted(places)])
    initial = np.kron(*(np.kron(first, np.arange(of.states) == 0) for first in own.initial))
    units = [np.divmod(joint, of.states) for joint in product(*map(range, of.state_counts))]
    joints = tuple(JointState(tuple(first.tolist()), tuple(state.tolist()), (False, False)) for first, state in units)
    return Product(of, own, joints, sources, targets, moved.T.astype(bool), share, initial)


def chains(of: Structure | None = None, components=(2, 2), sizes=(2, 1), seed=0, weights=(1.0, 1.0)) -> Chains:
    """Chains of random densities and tables, one stream of speech and one visual stream."""
    of = of or structure()
    joint = joint_product(of, seed)
    transitions = create_transitions(joint)
    draw = np.random.default_rng([seed, 1])
    advance = tuple(draw.uniform(0.2, 0.8, len(table)) for table in transitions.advance)
    transitions = type(transitions)(joint, transitions.rows, advance)
    together = [(0, 1)] if of.kind == HMM else [(0,), (1,)]
    groups = []
    for number, members in enumerate(together):
        chain = of.chain_of(members[0])
        edges = np.cumsum([0, *(sizes[s] for s in members)]).tolist()
        columns = tuple(slice(a, b) for a, b in pairwise(edges))
        shape = of.state_counts[chain], components[number], edges[-1]
        found = random_mixtures(np.random.default_rng([seed, 2, number]), shape, 1.0, 1.0, (0.5, 2))
        groups.append(
            StreamGroup(members, columns, found, tuple(weights[s] for s in members), joint.chain_states[chain])
        )
    return Chains(("speech", "seen"), transitions, tuple(groups))


def observations(frames=4, sizes=(2, 1), seed=0, seen: bool | float = True) -> AudioVisualObservations:
    """Return speech, and what is seen in all frames (True), in none (False), or in every other (0.5)."""
    draw = np.random.default_rng([seed, 3])
    streams = tuple(draw.normal(0, 1, (frames, size)).astype(np.float32) for size in sizes)
    return AudioVisualObservations(streams, (None, None if seen is True else np.arange(frames) % 2 < float(seen)))
