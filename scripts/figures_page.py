"""Writes the figures that pages state, from ``docs/results/figures/*.json``, and the page ``docs/results/figures.md``.

A sheet is one JSON file: ``page``, the page that it belongs to; ``tables`` by name, each with ``columns``, ``rows`` and
its stamp; ``stated``, what the text of that page says in figures beside the tables. The stamp of that is the table
``text``, which has no columns. A stamp is ``commit`` and ``date``, where the table was made; ``model``, what made it;
and ``command``. A page shows the model, and the command as long as there is its benchmark. A model is ``shipped`` and
the first digits of the SHA-256 of its file; an engine and the digest of its default options; ``none``, where no model
takes part; or words. Of several models, ``in row`` or ``in rows`` says which rows one made. A table without columns and
stamp need not stand in a page.

What an experiment stored in ``docs/results`` is not copied into a sheet. In a table with ``from``, the name of such a
file (or several, by a name each), every cell may have ``{path[to][value]:format}``. ``cells`` are those of the last
columns; then a row ends with keys instead, which stand for ``@0``, ``@1`` there: a cell of an empty key is empty.
``where`` has short names of paths. ``computed`` of a sheet has such texts, by file, on what the page says.

In a page a table stands between ``<!--figures:SHEET.TABLE-->`` and ``<!--end-->``. Run
``python scripts/figures_page.py`` after a change; ``--check`` writes nothing, and fails where something would change.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
SHEETS, OVERVIEW, SHIPPED = DOCS / "results" / "figures", DOCS / "results" / "figures.md", "grid-s1.lipmotion"
REGION = re.compile(r"(<!--figures:([\w-]+)\.([\w-]+)-->\n).*?(<!--end-->)", re.DOTALL)
PLACE = re.compile(r"{(\w+)((?:\[.*?\])*):?([^}]*)}")
UNITS = "%|ms|MB|GB|kB|dB|s|frames a second|times as fast"
FIGURE = re.compile(rf"(?<![\w.,])\d[\d,]*(?:\.\d+(?![\w]|\.\d)|(?= (?:{UNITS})(?!\w)))")
EXACT = re.compile(r"(?<![\w.,])0\.\d{3}(?!\d)")
"""In guides: numbers of three decimals, as correlations have; constants stand in spans of code."""

Sheet = Mapping[str, Any]


def as_shown(value: Any, form: str) -> str:
    """Return a stored value in a format of Python; ``*`` marks an interval without 0, and nothing stored is a dash."""
    if value is None:
        return "–"
    if form == "*":
        from lipmotion_lab.evaluation.evaluate import mark_significance

        return mark_significance(value)
    if isinstance(value, list):
        return (" to " if form.startswith("+") else "–").join(as_shown(each, form) for each in value)
    text = format(value, form)
    return text if isinstance(value, str) else text.replace("-", "−").replace("%", " %")


def formatted(form: str, stored: Mapping[str, Any]) -> str:
    """Return a text with stored values in place of ``{path[to][value]:format}``. Raises KeyError: nothing is there."""

    def value_at(match: re.Match[str]) -> str:
        value = stored[match[1]]
        for part in re.findall(r"\[(.*?)\]", match[2]):
            value = value[int(part) if isinstance(value, list) else part]
        return as_shown(value, match[3])

    return PLACE.sub(value_at, form)


def filled(table: Sheet, stored: Mapping[str, Any]) -> Sheet:
    """Return a table with the columns and rows that its formats make of what is stored. Raises KeyError: not there."""
    where, cells = table.get("where", {}), table.get("cells", [])
    typed = len(table["columns"]) - len(cells)

    def cell(form: str, *keys: str) -> str:
        form = re.sub(r"{(\w+)", lambda match: "{" + where.get(match[1], match[1]), form)
        for number, key in enumerate(keys):
            if not key and f"@{number}" in form:
                return ""
            form = form.replace(f"@{number}", key)
        return formatted(form, stored)

    rows = [[*map(cell, row[:typed]), *(cell(form, *row[typed:]) for form in cells)] for row in table["rows"]]
    return {**table, "columns": [*map(cell, table["columns"])], "rows": rows}


def stored_in(source: str | Mapping[str, str]) -> Any:
    """Return what an experiment stored in a file in ``docs/results``; of several files by the names given."""
    if isinstance(source, str):
        return json.loads((DOCS / "results" / source).read_text(encoding="utf-8"))
    return {name: stored_in(file) for name, file in source.items()}


def sheets() -> dict[str, Sheet]:
    """Return all sheets by name, with what their formats make of stored figures."""
    found = {}
    for path in sorted(SHEETS.glob("*.json")):
        sheet = json.loads(path.read_text(encoding="utf-8"))
        for name, table in sheet["tables"].items():
            sheet["tables"][name] = filled(table, stored_in(table["from"])) if "from" in table else table
        for file, forms in sheet.get("computed", {}).items():
            sheet["stated"] += [formatted(form, stored_in(file)) for form in forms]
        found[path.stem] = sheet
    return found


def current_models() -> frozenset[str]:
    """Return the stamps of what makes figures now: the shipped model, every engine with its defaults, no model."""
    from lipmotion.engines import ENGINES
    from lipmotion_lab.runner import digest_engine

    (model,) = (ROOT / "src" / "lipmotion").rglob(SHIPPED)
    shipped = f"shipped {hashlib.sha256(model.read_bytes()).hexdigest()[:8]}"
    return frozenset({"none", shipped, *(f"{name} {digest_engine(name)}" for name in ENGINES.built_in)})


def made_by(model: str, current: frozenset[str]) -> str:
    """Return what a page says of the models of a stamp; of one that is not the current one it says so."""
    earlier = [part for part in model.split(", ") if part.split(" in row")[0] not in current]
    if model == "none":
        return ""
    return f"Earlier model ({', '.join(earlier)})" if earlier else model


def stamp(table: Sheet, current: frozenset[str]) -> str:
    """Return the line below a table: its model and the command that made it; its commit and date are in the sheet.

    Of the figures in a text it says only what does not go without saying: an earlier model, or a command.
    """
    command, made = table.get("command", ""), made_by(table["model"], current)
    gone = any(not (ROOT / "benchmarks" / name).exists() for name in re.findall(r"benchmarks/(\w+\.py)", command))
    title = f"{table['title']}: " if table.get("title") and not table["columns"] else ""
    if title:
        made = made.replace("Earlier", "earlier") if "Earlier" in made else ""
    line = " · ".join(filter(None, [made, f"`{command}`" if command and not gone else ""]))
    return f"*{title}{line}*" if line else ""


def rendered(table: Sheet, current: frozenset[str]) -> str:
    """Return a table in Markdown, with its stamp; of one without columns the stamp alone."""
    if not table["columns"]:
        return f"{line}\n" if (line := stamp(table, current)) else ""
    cells = [table["columns"], *table["rows"]]
    head, *rows = (re.sub(r"\| +(?=\|)", "| ", f"| {' | '.join(row)} |") for row in cells)
    below = filter(None, [stamp(table, current)])
    return "\n".join([head, "|" + "---|" * len(table["columns"]), *rows, "", *below, ""])


def written(text: str, found: Mapping[str, Sheet], current: frozenset[str]) -> str:
    """Return a page with its tables as the sheets have them. Raises KeyError: there is no such sheet or table."""
    return REGION.sub(lambda m: m[1] + rendered(found[m[2]]["tables"][m[3]], current) + m[4], text)


def prose(text: str) -> str:
    """Return a page without tables of sheets, code, comments and the targets of links."""
    text = re.sub(r"^( *)```.*?^\1```", "", REGION.sub("", text), flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^ {4}.*$", "", text, flags=re.MULTILINE)
    return re.sub(r"<!--.*?-->|`[^`\n]*`|\]\([^)]*\)", "", text, flags=re.DOTALL)


def held(chosen: Iterator[Sheet]) -> str:
    """Return everything that sheets hold, as text."""
    parts = [[*(cell for t in s["tables"].values() for row in [t["columns"], *t["rows"]] for cell in row), *s["stated"]]
             for s in chosen]  # fmt: skip
    return "\n".join(cell for cells in parts for cell in cells)


def not_held(page: Path, text: str, found: Mapping[str, Sheet]) -> list[str]:
    """Return the figures that a page states outside of its tables, and that no sheet of it holds.

    Of results every figure counts, and the page's own sheet holds it, or one of those whose tables it shows; of guides
    numbers of three decimals, and any sheet may hold them. Decisions tell what was known then: not looked at.
    """
    name = page.relative_to(DOCS).as_posix() if page.is_relative_to(DOCS) else page.name
    shown = {match[2] for match in REGION.finditer(text)}
    own = (sheet for key, sheet in found.items() if sheet["page"] == name or key in shown)
    results = name.startswith("results/")
    pattern, chosen = (FIGURE, own) if results else (EXACT, iter(found.values()))
    known = set(pattern.findall(held(chosen)))
    return [figure for figure in pattern.findall(prose(text)) if figure not in known]


def overview(found: Mapping[str, Sheet], current: frozenset[str]) -> str:
    """Return the page of all figures: those at a glance, then the pages with figures of earlier models."""
    glance = found["glance"]
    lines = ["# Figures at a glance", "", *glance["text"], ""]
    for table in glance["tables"].values():
        lines += [f"## {table['title']}", "", *table.get("text", []), "", rendered(table, current)]
    lines += ["## All figures", "", *glance["all"], ""]
    earlier: dict[str, str] = {}
    for name, sheet in found.items():
        if name != "glance" and any("Earlier" in made_by(each["model"], current) for each in sheet["tables"].values()):
            target = f"../{sheet['page']}".replace("../results/", "")
            earlier.setdefault(target, f"[{Path(target).stem}]({target})")
    lines += [f"Pages with figures of an earlier model: {', '.join(earlier.values())}."]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"


def pages() -> list[Path]:
    """Return the pages that are looked at."""
    return [ROOT / "README.md", *(p for p in sorted(DOCS.rglob("*.md")) if p.parent.name != "decisions")]


def main() -> int:
    """Write all pages; with ``--check`` none. Return 1 where a page differed, or states what no sheet holds."""
    found, current, wrong = sheets(), current_models(), 0
    for page in pages():
        before = page.read_text(encoding="utf-8") if page.exists() else ""
        after = overview(found, current) if page == OVERVIEW else written(before, found, current)
        unknown = [] if page == OVERVIEW else not_held(page, after, found)
        if unknown or ("--check" in sys.argv and after != before):
            print(f"{page.relative_to(ROOT)}: {', '.join(unknown) or 'not as its sheets say'}")
            wrong = 1
        if "--check" not in sys.argv and after != before:
            page.write_text(after, encoding="utf-8")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
