"""Budgets of the house: lines and files, and what ``animate`` loads. They may only go down."""

import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from children import run_child

ROOT = Path(__file__).parents[2]
SOURCE_LINES, SOURCE_FILES = 78_600, 420
CORE_LINES = 47_978
LOADED_FILES, LOADED_LINES = 115, 20_020
TEST_LINES, BENCHMARK_LINES, DOC_WORDS = 51_480, 4_428, 44_200
LOADED = """
import sys, lipmotion
lipmotion.animate("examples/welcome.flac")
files = [module.__file__ for name, module in sys.modules.items() if name.partition(".")[0].startswith("lipmotion")]
print("\\n".join(filter(None, files)))
"""


def lines_of(paths: Iterable[Path]) -> int:
    return sum(path.read_bytes().count(b"\n") for path in paths)


def test_lines_and_files() -> None:
    source = list((ROOT / "src").rglob("*.py"))
    assert lines_of(source) <= SOURCE_LINES
    assert lines_of((ROOT / "src" / "lipmotion").rglob("*.py")) <= CORE_LINES
    assert len(source) <= SOURCE_FILES
    assert lines_of((ROOT / "tests").rglob("*.py")) <= TEST_LINES
    assert lines_of((ROOT / "benchmarks").rglob("*.py")) <= BENCHMARK_LINES
    assert sum(len(page.read_text("utf-8").split()) for page in (ROOT / "docs").rglob("*.md")) <= DOC_WORDS


@pytest.mark.long
def test_what_animate_loads() -> None:
    """The main path stands alone: for sound alone, no face, tracking, studio or reader of labels is loaded."""
    ran = run_child([sys.executable, "-c", LOADED], folder=ROOT, check=True)
    loaded = [Path(line) for line in ran.stdout.splitlines()]
    assert len(loaded) <= LOADED_FILES
    assert lines_of(loaded) <= LOADED_LINES
    rooms = {path.parts[path.parts.index("lipmotion") + 1] for path in loaded if "lipmotion" in path.parts}
    assert len(rooms) > 8
    assert not rooms & {"cli", "corpora.py", "formats", "meshes"}
    assert not [path for path in loaded if {"lipmotion_faces", "lipmotion_studio", "lipmotion_lab"} & {*path.parts}]
