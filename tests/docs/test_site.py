"""The documentation site: every page is in its sidebar, nothing comes from elsewhere, no warning when it is built."""

import re
import sys
from pathlib import Path

import pytest

from children import environment, run_child
from docs.site_pages import ROOT, SETTINGS, pages
from docs.test_links import links

TOOLS = Path(sys.prefix) / "site-tools"  # where ``make site`` installs Sphinx


def test_the_sidebar_holds_every_page_once():
    listed = pages()
    there = [ROOT / "tests/robustness/table.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "recipes").glob("*.md")]
    there += [page for page in ROOT.glob("*.md") if page.name != "README.md"]
    assert len(set(listed)) == len(listed)
    assert {f"{page}.md" for page in listed} == {page.relative_to(ROOT).as_posix() for page in there}
    assert next(iter(SETTINGS.sections(SETTINGS.INDEX))).startswith("Tutorials")
    assert ":caption: Results\n\n/docs/limits\n" in SETTINGS.sidebar(SETTINGS.INDEX)


def test_pages_link_files_not_folders():
    """GitHub shows folders, the site does not."""
    for page in pages():
        path = ROOT / f"{page}.md"
        inside = [target for target in links(path.read_text("utf-8")) if not re.match("[a-z]+:|#", target)]
        assert [target for target in inside if not (path.parent / target.partition("#")[0]).is_file()] == [], page


def test_nothing_from_elsewhere_is_named():
    assert not re.search(r"https?:|//", (ROOT / "docs" / "conf.py").read_text(encoding="utf-8"))


def test_lists_of_arguments_become_field_lists():
    given = [
        "Return it.", "path, name : where", "             it is", "rate_hz : frames", "Note: none.",
        "Raises A, B: bad.",
    ]  # fmt: skip
    made = [
        ":param path,name: where", "             it is", ":param rate_hz: frames", "", "Note: none.", "",
        ":raises A,B: bad.",
    ]  # fmt: skip
    assert SETTINGS.restructured(given) == ["Return it.", "", *made]


@pytest.mark.long
def test_the_site_is_built_without_a_warning(tmp_path):
    if not TOOLS.is_dir():
        pytest.skip("make site installs the tools")
    site = tmp_path / "site"
    command = [
        sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-c", ROOT / "docs", "-d", tmp_path / "cache",
    ]  # fmt: skip
    run_child([*command, ROOT, site], variables=environment(PYTHONPATH=f"{ROOT / 'src'}:{TOOLS}"), check=True)
    for page in pages():
        text = (site / f"{page}.html").read_text(encoding="utf-8")
        assert re.findall(r"<(?:link|script|img|iframe)[^>]*(?:href|src)=\"(?:https?:)?//[^\"]*", text) == [], page
    api = (site / "docs" / "api.html").read_text(encoding="utf-8")
    assert all(f'id="lipmotion.{name}"' in api for name in ("animate", "Request", "train"))
    assert 'id="lipmotion.engines.trajectory.model.TrajectoryConfig"' in api
    assert "docs/index.html" in (site / "index.html").read_text(encoding="utf-8")
