import re
import shutil
import sys
from pathlib import Path

import pytest

from children import environment, run_child

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
FEW_STEPS = "from lipmotion.motion import posterior_network as n; n.STEPS = n.RECURRENT_STEPS = 4.0"
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.long
def test_every_block_of_the_page_runs(toy_corpus, tmp_path):
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


def test_every_section_has_a_block_and_uses_the_modules_that_its_title_names():
    sections = PAGE.split("\n## ")[1:]
    assert len(sections) >= 9
    for section in sections:
        assert "```python" in section
        title, text = section.split("\n", 1)
        modules = [name for name in re.findall(r"`(lipmotion[\w.]*)`", title) if name != "lipmotion"]
        assert [name for name in modules if name not in text] == []
