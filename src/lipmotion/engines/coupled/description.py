"""A text that describes the parts of a coupled model."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap

from lipmotion.engines.coupled.chains.product import Product
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM
from lipmotion.engines.coupled.conversion.em_conversion import group_index
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.printable import printable

KINDS = {
    HMM: "one chain, one mixture over all streams",
    MULTISTREAM: "one chain, a mixture for each stream",
    FACTORIAL: "chains with independent transitions, densities of their joint states",
    COUPLED: "chains whose transitions depend on all chains, densities of their own states",
}
LINE = 110


def describe(model: CoupledModel) -> str:
    """Return a text with the chains, the streams and the regressions of a model, one a line."""
    return "\n".join(map(printable, [*_chains(model), *_streams(model), *_regressions(model)]))


def _chains(model: CoupledModel) -> Iterator[str]:
    structure, product = model.chains.structure, model.chains.transitions.product
    yield f"{structure.kind}: {KINDS[structure.kind]}"
    if len(structure.chains) > 1:
        apart = "any number of states" if structure.limit is None else f"up to {structure.limit} state(s)"
        together = "" if structure.cross_units or structure.limit is None else ", units left together"
        yield f"  asynchrony: {apart} apart{together}"
    count = len(product.joint_states) if isinstance(product, Product) else product.chain_states.shape[1]
    yield f"  joint states: {count}"
    for number, (chain, units) in enumerate(zip(structure.chains, structure.units, strict=True), start=1):
        yield f"chain {number}: {chain.name}, {len(units)} units of {structure.states} states"
        yield from (f"  {line}" for line in wrap(" ".join(units), LINE))


def _streams(model: CoupledModel) -> Iterator[str]:
    chains = model.chains
    for number, name in enumerate(chains.streams):
        mixtures = chains.groups[group_index(chains, number)].stream_mixtures(number)
        densities, components, size = mixtures.means.shape
        chain = chains.structure.chain_of(number) + 1
        yield f"stream {name}: {size} dimensions on chain {chain}, {densities} densities of {components} Gaussian(s)"


def _regressions(model: CoupledModel) -> Iterator[str]:
    regressions = model.regression[1] if model.regression is not None else ()
    for stream, regression in zip(model.visual, regressions, strict=False):
        count, inputs, _ = regression.coefficients.shape
        yield f"means of {stream.name}: {count} regressions on {inputs} inputs, from features and posteriors around"
