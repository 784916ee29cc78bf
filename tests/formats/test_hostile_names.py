from pathlib import Path

import pytest

from formats.hostile_names import WRITERS, names, outcome


@pytest.mark.parametrize("step", [151, pytest.param(3, marks=pytest.mark.long)])  # by 3: every part in some form
@pytest.mark.parametrize("writer", WRITERS)
def test_names_are_kept_or_refused(writer: str, step: int, tmp_path: Path) -> None:
    found = {name: outcome(writer, tmp_path, name) for name in list(names())[::step]}
    assert "kept" in found.values()
    assert set(found.values()) <= {"kept", "refused"}, found
