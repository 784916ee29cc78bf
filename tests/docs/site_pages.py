"""The pages of the documentation site, and their blocks of commands and Python."""

import importlib.util
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent
from types import ModuleType

ROOT = Path(__file__).parents[2]
FENCED = re.compile(
    r"(?:^ *<!--long: (?P<last>[^>]*?)-->\n)?^(?P<indent> *)```(?P<language>\w*)\n(?P<text>.*?)^(?P=indent)```$",
    re.M | re.DOTALL,
)
INDENTED = re.compile(r"(?:^<!--long: (?P<last>[^>]*?)-->\n|(?<=\n\n))(?P<text>(?:    \S.*\n(?:     .*\n)*)+)", re.M)
LANGUAGES = {"sh": "sh", "py": "python", "python": "python"}
COMMAND = re.compile(r"(?:lipmotion|python|make|pip|ffmpeg|dask|export) ")


def module_at(path: str) -> ModuleType:
    """Return a module of the repository that is in no package; the settings of the site do not need Sphinx."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SETTINGS = module_at("docs/conf.py")


def pages() -> list[str]:
    """Return the pages of the site in the order of the sidebar, without suffix."""
    inside = [page for index in SETTINGS.INDEXES for listed in SETTINGS.sections(index).values() for page in listed]
    return [SETTINGS.INDEX, *inside]


@dataclass(frozen=True)
class Block:
    """Commands or Python on a page.

    language : ``sh`` or ``python``
    last     : what the marker above it says: the date of its last run, and the output; empty: there is no marker
    """

    page: str
    language: str
    text: str
    last: str


def blocks(page: str) -> Iterator[Block]:
    """Yield what a page says to type, in order."""
    text = (ROOT / f"{page}.md").read_text(encoding="utf-8")
    found = [*FENCED.finditer(text)]
    bare = FENCED.sub(lambda match: re.sub(r"\S", "x", match[0]), text)
    found += [match for match in INDENTED.finditer(bare) if COMMAND.match(match["text"].strip())]
    for match in sorted(found, key=lambda match: match.start()):
        language = LANGUAGES.get(match.groupdict().get("language", "sh"))
        if language:
            yield Block(page, language, dedent(match["text"]), match["last"] or "")
