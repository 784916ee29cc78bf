"""What a coupled model is made of, in words."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap

from lipmotion.engines.coupled.chains.product import Product
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, MULTISTREAM
from lipmotion.engines.coupled.conversion.em import group_of
from lipmotion.engines.coupled.model import CoupledModel
from lipmotion.printable import printable

KINDS = {
    HMM: "one chain, one mixture over all streams",
    MULTISTREAM: "one chain, a mixture for each stream",
    FACTORIAL: "chains that move on their own, densities of their joint states",
    COUPLED: "chains whose moves depend on all chains, densities of their own states",
}
LINE = 110


def described(model: CoupledModel) -> str:
    """Return chains, streams and what the means follow, line by line."""
    return "\n".join(map(printable, [*_chains(model), *_streams(model), *_following(model)]))


def _chains(model: CoupledModel) -> Iterator[str]:
    structure, product = model.chains.structure, model.chains.transitions.product
    yield f"{structure.kind}: {KINDS[structure.kind]}"
    if len(structure.chains) > 1:
        apart = "any number of states" if structure.limit is None else f"up to {structure.limit} state(s)"
        together = "" if structure.crosses or structure.limit is None else ", units left together"
        yield f"  asynchrony: {apart} apart{together}"
    count = len(product.joints) if isinstance(product, Product) else product.chain_states.shape[1]
    yield f"  joint states: {count}"
    for number, (chain, units) in enumerate(zip(structure.chains, structure.units, strict=True), start=1):
        yield f"chain {number}: {chain.name}, {len(units)} units of {structure.states} states"
        yield from (f"  {line}" for line in wrap(" ".join(units), LINE))


def _streams(model: CoupledModel) -> Iterator[str]:
    chains = model.chains
    for number, name in enumerate(chains.streams):
        mixtures = chains.groups[group_of(chains, number)].of_stream(number)
        densities, components, size = mixtures.means.shape
        place = chains.structure.chain_of(number) + 1
        yield f"stream {name}: {size} numbers on chain {place}, {densities} densities of {components} Gaussian(s)"


def _following(model: CoupledModel) -> Iterator[str]:
    for stream, following in zip(model.visual, model.follow[1] if model.follow is not None else (), strict=False):
        count, inputs, _ = following.coefficients.shape
        yield f"means of {stream.name}: {count} regressions on {inputs} numbers of what is heard and believed around"
