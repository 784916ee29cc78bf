"""The whole agents of ``examples/live``, as a reader starts them, offline."""

import sys
from pathlib import Path

import pytest

from children import TO_STDOUT, run_child

EXAMPLES = Path(__file__).parents[2] / "examples" / "live"


@pytest.mark.parametrize(
    ("framework", "name", "words"),
    [("pipecat", "pipecat_agent.py", []), ("livekit.agents", "livekit_agent.py", ["offline"])],
)
def test_an_example_moves_the_jaw_and_fails_in_nothing(framework: str, name: str, words: list[str]) -> None:
    pytest.importorskip(framework, exc_type=ImportError)
    done = run_child([sys.executable, EXAMPLES / name, *words], stderr=TO_STDOUT)
    assert done.returncode == 0
    assert " s ####" in done.stdout
    assert "ERROR" not in done.stdout
