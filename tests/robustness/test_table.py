import json
import sys

import pytest

from robustness.case import CASES
from robustness.document import DOCUMENT, rendered

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="pipes, devices and names as Linux has them")


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.group}: {case.name}")
def test_bad_input(case, bench, run, here, caplog):
    if case.group == "videos":
        pytest.importorskip("mediapipe")
    done = run(*case.make(bench))
    printed = " ".join([*done.err, *(record.getMessage() for record in caplog.records)])
    assert done.code == case.code, done
    assert "Traceback" not in printed
    for words in case.messages:
        assert words in printed
    if case.code:
        assert done.out == []
        *before, last = done.err
        assert last.startswith("lipmotion: error: ")
        assert all(line.startswith("lipmotion: warning: ") for line in before)
        assert sum("skipped" in line for line in before) == ("none of 1 recordings" in last)
        assert list(here.iterdir()) == []
    else:
        assert all(line.startswith("lipmotion: warning: ") for line in done.err)
        assert bool(caplog.records or done.err) == bool(case.messages), printed
        for path in here.glob("*.json"):
            json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)


def test_there_are_many_and_none_twice():
    names = [(case.group, case.name) for case in CASES]
    assert len(names) >= 150
    assert len(set(names)) == len(names)


def test_the_document_has_all_of_them():
    """To update it, run ``python -m robustness.document`` with the folder ``tests`` in PYTHONPATH."""
    assert rendered() == DOCUMENT.read_text(encoding="utf-8")
