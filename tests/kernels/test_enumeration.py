import pytest

from kernels.enumeration import RECURSIONS, SPREADS, is_right
from lipmotion.kernels.sequences import factorial, forward_backward, network, viterbi, windowed_viterbi

ONCE_WRONG = {
    "network, double": [(30, 1), (300, 261), (1e4, 291), (1e5, 113)],
    "network, single": [(30, 115), (300, 45), (300, 67), (1e5, 197)],
    "products of 2 chains, double": [(100, 241), (300, 131), (1e3, 265), (1e4, 209)],
    "products of 2 chains, single": [(30, 193), (100, 123), (1e3, 43), (1e5, 223)],
    "network with a block, double": [(30, 135), (100, 57), (300, 53), (1e3, 219)],
    "network with a block, single": [(30, 79), (100, 145), (300, 51), (1e4, 277)],
    "factorial, double": [(1e4, 46), (1e5, 148)],
    "factorial, single": [(30, 135), (100, 61), (300, 119), (1e3, 18)],
}
"""Spreads and numbers of cases in which probabilities counted that compiled forms once set to 0, or raised."""


@pytest.fixture(params=["numpy", "compiled"], autouse=True)
def form(request, monkeypatch) -> None:
    """Every test runs with both forms, NumPy and compiled."""
    if request.param == "compiled":
        pytest.importorskip("numba")
    for module in (network, factorial):
        monkeypatch.setattr(module, "numba_works", lambda: request.param == "compiled")
    for module in (viterbi, windowed_viterbi, forward_backward):
        monkeypatch.setattr(module, "compiled_pays", lambda _: request.param == "compiled")


@pytest.mark.parametrize("name", RECURSIONS)
def test_no_recursion_loses_a_path_however_far_densities_and_probabilities_spread(name):
    cases = [(spread, number) for spread in SPREADS for number in range(4)] + ONCE_WRONG.get(name, [])
    assert [case for case in cases if not is_right(name, *case)] == []
