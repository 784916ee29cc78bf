"""Settings of the documentation site, which ``make site`` builds (docs/decisions/studies-and-pages.md).

Sphinx reads the repository as it lies, so that links between pages are the same here, on the web and on GitHub. What
the sidebar shows, and in which order, is said by docs/index.md alone. Nothing of this file needs Sphinx but ``setup``.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
INDEX, NAMES = "docs/index", "docs/api"
INDEXES = (INDEX, "recipes/README")
"""The pages whose links make the sidebar; the second one is inside the first."""
FIELD, RAISED = re.compile(r"([a-z]\w*(?:, [a-z]\w*)*) *: (.*)"), re.compile(r"Raises ([\w, ]+): (.*)")

project, author, copyright = "lipmotion", "", ""
root_doc = INDEX
include_patterns = ["docs/**.md", "recipes/*.md", "tests/robustness/table.md", "*.md"]
exclude_patterns = ["README.md", "build", ".*"]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 6
suppress_warnings = ["myst.header", "misc.highlighting_failure"]
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True}
maximum_signature_line_length = 80
html_theme = "furo"
html_title = "lipmotion"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_static_path: list[str] = []


def sections(index: str) -> dict[str, list[str]]:
    """Return the pages that an index links, without suffix, by the headings they stand under; each page once.

    index : path of the page in the repository, without suffix; the one inside the first has the pages of its folder
    """
    page = ROOT / f"{index}.md"
    found: dict[str, list[str]] = {}
    seen, folder = {index}, "" if index == INDEX else f"{Path(index).parent.as_posix()}/"
    parts = re.split(r"^## ", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    for part in parts[1:] or parts:
        title, text = part.removeprefix("# ").split("\n", 1)
        targets = [os.path.normpath(page.parent / target) for target in re.findall(r"\]\(([^():#]+)\.md[)#]", text)]
        names = [Path(target).relative_to(ROOT).as_posix() for target in targets]
        found[title] = [name for name in dict.fromkeys(names) if name not in seen and name.startswith(folder)]
        seen.update(names)
    return found


def sidebar(index: str) -> str:
    """Return the sections of an index as tables of contents that only the sidebar shows."""
    return "".join(
        f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n" + "".join(f"/{page}\n" for page in pages) + "```\n"
        for title, pages in sections(index).items()
        if pages
    )


def from_docstrings() -> str:
    """Return sections with every name in ``lipmotion.__all__``, and with the options of every engine."""
    import lipmotion
    from lipmotion.engines import ENGINES

    public = {name: isinstance(getattr(lipmotion, name), type) for name in lipmotion.__all__}
    names = [f".. auto{'class' if is_class else 'function'}:: lipmotion.{name}" for name, is_class in public.items()]
    options = [ENGINES.load(name).Config for name in ENGINES.built_in]
    configurations = [f".. autoclass:: {each.__module__}.{each.__name__}" for each in options]
    return "".join(
        f"\n## {title}\n\n```{{eval-rst}}\n{chr(10).join(directives)}\n```\n"
        for title, directives in (("Every public name", names), ("Options of the engines", configurations))
    )


def restructured(lines: list[str]) -> list[str]:
    """Return a docstring with its lists of arguments and errors as field lists."""
    made: list[str] = []
    in_field = False
    for line in lines:
        raised = RAISED.fullmatch(line)
        found = raised or FIELD.fullmatch(line)
        if found:
            made += [] if in_field else [""]
            kind = "raises" if raised else "param"
            made.append(f":{kind} {re.sub(r'(,| and) ', ',', found[1])}: {found[2]}")
        else:
            made += [""] if in_field and line and not line.startswith(" ") else []
            made.append(line)
        in_field = bool(found) or (in_field and line.startswith(" "))
    return made


def setup(app: Sphinx) -> None:
    """Let Sphinx add the sidebar, the docstrings, and an address for the site as a whole."""

    def add_made_parts(_: Sphinx, page: str, source: list[str]) -> None:
        source[0] += sidebar(page) if page in INDEXES else ""
        source[0] += from_docstrings() if page == NAMES else ""

    def rewrite(_app: Sphinx, _what: str, _name: str, _value: object, _options: object, lines: list[str]) -> None:
        lines[:] = restructured(lines)

    def lead_to_index(_: Sphinx, failed: Exception | None) -> None:
        if failed is None:
            head = f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={INDEX}.html">'
            (Path(app.outdir) / "index.html").write_text(
                f'{head}<title>lipmotion</title><a href="{INDEX}.html">lipmotion</a>\n', encoding="utf-8"
            )

    app.connect("source-read", add_made_parts)
    app.connect("autodoc-process-docstring", rewrite)
    app.connect("build-finished", lead_to_index)
