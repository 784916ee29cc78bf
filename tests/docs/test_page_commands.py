"""The commands on the pages of one screen and on the recipes are ones that the command line understands."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from lipmotion.cli.command_line import parser

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted([*DOCS.glob("for/*.md"), *DOCS.glob("recipes/*.md"), DOCS / "batch.md", DOCS / "study.md"])


def commands(page: Path) -> list[list[str]]:
    """Return the words of each command in the blocks of a page."""
    blocks = re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines() if line.startswith("lipmotion ")]
    return [shlex.split(line, comments=True)[1:] for line in lines]


def test_commands_are_understood() -> None:
    understood = parser()
    for page in PAGES:
        assert commands(page), page
        for words in commands(page):
            assert understood.parse_args(words).verb == words[0]
