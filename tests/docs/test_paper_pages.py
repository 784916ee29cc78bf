"""The pages of the papers: what they say of equations, functions and tests is there."""

import re

from docs.test_links import DOCS

ROOT = DOCS.parent
NAMED = re.compile(r"`((?:\w+/)+\w+\.py)::(\w+)`")


def test_every_function_and_test_of_an_equation_exists() -> None:
    found = [match for page in (DOCS / "papers").glob("*.md") for match in NAMED.findall(page.read_text("utf-8"))]
    assert len(found) > 10
    for path, name in found:
        (place,) = [root / path for root in (ROOT / "src" / "lipmotion", ROOT / "tests") if (root / path).is_file()]
        assert f"def {name}(" in place.read_text("utf-8"), (path, name)
