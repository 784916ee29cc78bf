"""The recipes for published corpora: three commands each."""

import re
import shlex
from pathlib import Path

from docs.test_links import broken
from lipmotion.cli.command_line import parser

FOLDER = Path(__file__).parents[2] / "recipes"
INDEX = FOLDER / "README.md"
PAGES = sorted(page for page in FOLDER.glob("*.md") if page != INDEX)
MAX_LINES = 40


def commands(page: Path) -> list[list[str]]:
    """Return the commands in the blocks of a page, each as its words."""
    (block,) = re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return [shlex.split(line)[1:] for line in block.splitlines()]


def test_a_recipe_is_a_short_page_with_three_commands():
    understood, index = parser(), INDEX.read_text(encoding="utf-8")
    assert len(PAGES) >= 6
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert len(text.splitlines()) <= MAX_LINES
        assert f"({page.name})" in index
        prepare, train, folds = map(understood.parse_args, commands(page))
        assert (prepare.verb, train.verb, folds.verb) == ("corpus", "train", "experiment")
        assert prepare.output == train.corpus == folds.corpus
        assert (train.start, folds.by_speaker) == ("none", True)
        assert f"    {prepare.recordings.parts[0]}/\n" in text


def test_links_of_the_recipes_resolve():
    assert {page.name: broken(page.read_text(encoding="utf-8"), page) for page in (INDEX, *PAGES)} == {
        page.name: [] for page in (INDEX, *PAGES)
    }
