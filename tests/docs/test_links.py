"""Links of all Markdown files resolve, and what pages name of modules, options, equations and tests is there."""

import re
from collections.abc import Iterator
from dataclasses import fields
from functools import cache
from itertools import chain
from pathlib import Path

import pytest

from children import run_child
from lipmotion.engines import ENGINES

ROOT = Path(__file__).parents[2]
DOCS, INDEX = ROOT / "docs", ROOT / "docs" / "index.md"
PAGES = sorted(
    path
    for path in chain(ROOT.glob("*.md"), *((ROOT / folder).rglob("*.md") for folder in ("docs", "tests", "examples")))
    if "build" not in path.parts
)
CODE_ROOTS = (ROOT, ROOT / "src" / "lipmotion", ROOT / "src", ROOT / "tests")


def links(text: str) -> Iterator[str]:
    """Give the targets of all links and pictures of a page; brackets in code are no links."""
    text = re.sub(r"^( *)```.*?^\1```", "", text, flags=re.MULTILINE | re.DOTALL)
    yield from re.findall(r"\]\(([^()\s]+)\)", re.sub(r"`[^`\n]*`", "", text))


def anchors(page: Path) -> set[str]:
    """Return the names that the headings of a page have on the web."""
    lines = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL).splitlines()
    titles = [line.lstrip("#").strip().lower() for line in lines if re.match(r"#+ ", line)]
    return {
        re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title)).replace(" ", "-") for title in titles
    }


def broken(text: str, page: Path) -> list[str]:
    """Return the relative links that lead nowhere, in a text that stands at ``page``."""
    found = []
    for target in links(text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        inside = file.is_relative_to(ROOT)
        if not inside or not file.exists() or (anchor and anchor not in anchors(file)):
            found.append(target)
    return found


def test_relative_links_resolve():
    found = {str(page.relative_to(ROOT)): broken(page.read_text(encoding="utf-8"), page) for page in PAGES}
    assert {page: targets for page, targets in found.items() if targets} == {}


def test_a_broken_link_is_found():
    text = "[a](gone.md) [b](index.md#gone) [c](/etc) `[d](code.md)` ![e](images/welcome.png) [f](index.md#results)"
    assert broken(text, INDEX) == ["gone.md", "index.md#gone", "/etc"]


def test_the_index_links_every_page():
    linked = {(DOCS / target.partition("#")[0]).resolve() for target in links(INDEX.read_text(encoding="utf-8"))}
    assert [str(page.relative_to(ROOT)) for page in DOCS.rglob("*.md") if page not in {*linked, INDEX}] == []


def test_the_readme_leads_to_the_index():
    assert "docs/index.md" in set(links((ROOT / "README.md").read_text(encoding="utf-8")))


def test_named_files_of_the_source_exist():
    """Paths such as `speech/features/mfcc.py` in spans of code: of the package, of the tests, or of the repository."""
    first = {path.name for root in CODE_ROOTS for path in root.iterdir()}
    for page in PAGES:
        if page.parent == DOCS / "extend":
            continue
        named = re.findall(r"`((?:[a-z_0-9]+/)+(?:[a-z_0-9]+\.py)?|[a-z_0-9]+\.py)`", page.read_text(encoding="utf-8"))
        missing = [name for name in named if not any((root / name).exists() for root in CODE_ROOTS)]
        assert [(page, name) for name in missing if name.endswith(".py") or name.split("/")[0] in first] == []


def test_no_page_uses_a_former_name_of_an_option():
    configurations = [ENGINES.load(name).Config for name in ENGINES.built_in]
    present = {field.name for config in configurations for field in fields(config)}
    former = {old for config in configurations for old in config.aliases} - present - {*ENGINES.built_in}
    assert {"listens", "follows", "full_range", "crosses", "recognises"} <= former
    setting = re.compile(rf"`(?:--set )?({'|'.join(sorted(former))})`|\b({'|'.join(sorted(former))}) ?= ?\w")
    assert {
        f"{page.relative_to(ROOT)}: {match.group()}"
        for page in PAGES
        if page.name != "CHANGELOG.md"
        for match in setting.finditer(page.read_text(encoding="utf-8"))
    } == set()


def test_readme_is_short():
    text = re.sub(r"!\[[^]]*\]\([^)]*\)", "", (ROOT / "README.md").read_text(encoding="utf-8"))
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text)
    assert len([word for word in text.split() if re.search(r"\w", word)]) <= 600


def test_the_figures_of_the_readme_stand_in_the_results():
    section = (ROOT / "README.md").read_text(encoding="utf-8").split("## How good it is")[1].split("\n## ")[0]
    given = set(re.findall(r"\b0\.\d+", section))
    results = (DOCS / "results" / "figures.md").read_text(encoding="utf-8")
    assert len(given) >= 6
    assert given - set(re.findall(r"\b0\.\d+", results)) == set()


def test_all_pages_say_the_same_of_how_long_training_takes():
    pages = [(ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/verbs.md")]
    said = [re.findall(r"(\w+ \w+ \w+) for 22 minutes of recordings", page) for page in pages]
    assert said == [["about sixteen minutes"], ["about sixteen minutes"]]
    speed = (DOCS / "results" / "figures.md").read_text(encoding="utf-8").split("## Speed")[1]
    (seconds,) = re.findall(r"`train`, 452 clips of GRID s1 \(22 minutes\), .* \| (\d+) s \|", speed)
    assert 900 <= float(seconds) <= 1020


def test_no_package_registry_and_no_absolute_path_is_named():
    listed = run_child(["git", "ls-files"], folder=ROOT)
    if listed.returncode:
        pytest.skip("not a git repository")
    endings = {".md", ".toml", ".cff", ".yml", ".yaml", ".in", ".txt", ".bib"}
    texts = [ROOT / name for name in listed.stdout.splitlines() if Path(name).suffix in endings]
    hosts = re.compile(r"py" + r"pi\.org|python" + r"hosted\.org|registry\.npm" + r"js|/ho" + r"me/\w|/ro" + r"ot/")
    assert [path.name for path in texts if path.is_file() and hosts.search(path.read_text(encoding="utf-8"))] == []


SOURCE, CORE, TESTS = ROOT / "src", ROOT / "src" / "lipmotion", ROOT / "tests"
PAPERS = {"hofer2008": 12, "xieliu2007": 21, "minnis2000": 0}
"""The pages, and how many equations each paper numbers, besides those of appendices."""
CONFIGURATIONS = [ENGINES.load(name).Config for name in ("joint", "coupled", "selection")]
NAMED = re.compile(r"`((?:\w+/)+\w+\.py)::(\w+)`")
DEFINED = re.compile(r"^ *(?:(?:def|class) (\w+)|(\w+)(?:: [^=\n]+)? = )", re.MULTILINE)
FENCES = re.compile(r"```.*?```", re.DOTALL)


@cache
def defined(folder: Path) -> frozenset[str]:
    """Return the names of modules, functions, classes, constants and attributes in a folder."""
    paths = list(folder.rglob("*.py"))
    found = (name for path in paths for names in DEFINED.findall(path.read_text("utf-8")) for name in names)
    return frozenset(found) | {path.stem for path in paths} | {path.parent.name for path in paths}


def text(page: str) -> str:
    """Return a page without its commands."""
    return FENCES.sub("", (DOCS / "papers" / f"{page}.md").read_text("utf-8"))


def test_every_function_and_test_of_an_equation_exists():
    found = [match for page in PAPERS for match in NAMED.findall(text(page))]
    assert len(found) > 10
    for path, name in found:
        (place,) = [root / path for root in (CORE, SOURCE, TESTS) if (root / path).is_file()]
        assert f"def {name}(" in place.read_text("utf-8"), (path, name)


def test_names_without_a_path_exist():
    names = [name for page in PAPERS for name in re.findall(r"`([A-Za-z_][\w.]*)`", text(page))]
    tests = [name for name in names if name.startswith("test_")]
    functions = [name for name in names if "." in name]
    assert min(len(tests), len(functions)) > 20
    assert [name for name in tests if name not in defined(TESTS)] == []
    assert [name for name in functions if not defined(SOURCE).issuperset(name.split("."))] == []


def test_options_exist():
    options = {each.name for config in CONFIGURATIONS for each in fields(config)}
    pages = [(DOCS / "papers" / f"{page}.md").read_text("utf-8") for page in PAPERS]
    named = [name for page in pages for name in re.findall(r"(?:`|--set \"?)(\w+)=", page)]
    assert len(named) > 10
    assert [name for name in named if name not in options] == []


@pytest.mark.parametrize("page", [page for page, count in PAPERS.items() if count])
def test_every_equation_has_a_row_with_a_function_and_a_test(page):
    numbers = set()
    for row in re.findall(r"^\| (.+?) \|(.+`.+)\|(.*`.+`.*)\|$", text(page), re.MULTILINE):
        for first, last in re.findall(r"(?<![\w.])(\d+)(?:–(\d+))?(?![\w.])", re.sub(r"§[\d.]+|Fig. \d+", "", row[0])):
            numbers |= set(range(int(first), int(last or first) + 1))
    assert numbers.issuperset(range(1, PAPERS[page] + 1)), sorted(set(range(1, PAPERS[page] + 1)) - numbers)
