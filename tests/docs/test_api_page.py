"""docs/api.md, run from top to bottom."""

from __future__ import annotations

import pkgutil
import re
import shutil
import sys
from pathlib import Path

import pytest

from children import environment, run_child
from lipmotion import Corpus

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
FEW_STEPS = "from lipmotion.motion import posterior_network as n; n.STEPS = n.RECURRENT_STEPS = 4.0"
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.long
def test_every_block_of_the_page_runs(toy_corpus: Corpus, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    shutil.copytree(toy_corpus.path, tmp_path / "my-corpus")
    done = run_child(
        [sys.executable, "-W", "error", "-c", "\n".join([FEW_STEPS, *BLOCKS])],
        folder=tmp_path,
        variables=environment(NUMBA_DISABLE_PERFORMANCE_WARNINGS="1"),
        check=True,
    )
    assert len(done.stdout.splitlines()) > len(BLOCKS)
    assert {"welcome.json", "welcome.csv", "welcome.tsv", "small.lipmotion"} <= {p.name for p in tmp_path.iterdir()}


def test_every_section_but_the_last_has_a_block() -> None:
    sections = PAGE.split("\n## ")[1:]
    assert len(sections) >= 7
    assert [section.splitlines()[0] for section in sections if "```python" not in section] == ["More"]


def test_the_names_in_its_tables_exist() -> None:
    named = re.findall(r"`(lipmotion(?:_\w+)?(?:\.\w+)+)`", PAGE)
    assert len(named) > 15
    for name in named:
        assert pkgutil.resolve_name(name) is not None
