from pathlib import Path

import pytest

from formats.hostile_names import WRITERS, names, outcome

SOME = list(names())[::151]


@pytest.mark.parametrize("writer", WRITERS)
def test_names_are_kept_or_refused(writer: str, tmp_path: Path) -> None:
    found = {name: outcome(writer, tmp_path, name) for name in SOME}
    assert "kept" in found.values()
    assert set(found.values()) <= {"kept", "refused"}


@pytest.mark.long
@pytest.mark.parametrize("writer", WRITERS)
def test_all_names_are_kept_or_refused(writer: str, tmp_path: Path) -> None:
    for name in names():
        assert outcome(writer, tmp_path, name) in {"kept", "refused"}, ascii(name)
