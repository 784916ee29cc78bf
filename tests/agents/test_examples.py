"""The whole agents of ``examples/live``, offline."""

import sys

import pytest

from agents import WELCOME
from children import TO_STDOUT, run_child


@pytest.mark.parametrize(("framework", "words"), [("pipecat", []), ("livekit", ["offline"])])
def test_an_example_fails_in_nothing(framework: str, words: list[str]) -> None:
    pytest.importorskip(framework, exc_type=ImportError)
    done = run_child([sys.executable, WELCOME.parent / "live" / f"{framework}_agent.py", *words], stderr=TO_STDOUT)
    assert (done.returncode, " s ####" in done.stdout, "ERROR" in done.stdout) == (0, True, False), done.stdout[-2000:]
