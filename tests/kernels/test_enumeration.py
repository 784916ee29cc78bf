import pytest

from kernels.enumeration import RECURSIONS, SPREADS, is_right
from lipmotion.kernels import paths

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


@pytest.fixture(params=["numpy", "compiled"])
def form(request, monkeypatch) -> None:
    """What has two forms is tested in both."""
    if request.param == "compiled":
        pytest.importorskip("numba")
    monkeypatch.setattr(paths, "pays", lambda _: request.param == "compiled")


def wrong_cases(name: str) -> list[tuple[float, int]]:
    cases = [(spread, number) for spread in SPREADS for number in range(4)] + ONCE_WRONG.get(name, [])
    return [case for case in cases if not is_right(name, *case)]


@pytest.mark.parametrize("name", [name for name in RECURSIONS if not name.startswith("best path")])
def test_no_recursion_loses_a_path_however_far_densities_and_probabilities_spread(name):
    assert wrong_cases(name) == []


@pytest.mark.usefixtures("form")
@pytest.mark.parametrize("name", ["best path", "best path in windows"])
def test_no_search_loses_the_best_path_however_far_densities_and_probabilities_spread(name):
    assert wrong_cases(name) == []
