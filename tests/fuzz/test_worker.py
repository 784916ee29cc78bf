"""The process that reads, with a reader that has defects."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fuzz.campaign import Tally, campaign
from fuzz.findings import keep, smallest
from fuzz.inputs import Files, Good, picked_up
from fuzz.judge import CRASH, ERROR, HANG, IMPLAUSIBLE, LEFT, MEMORY, READ, REFUSED
from fuzz.planted import MEGABYTES, readers
from fuzz.worker import Worker

ORDERS = {
    **{"raise": ERROR, "lie": IMPLAUSIBLE, "drop": LEFT, "spoil": LEFT},
    **{"refuse": REFUSED, "now": READ},
}


NOWHERE = Good(Path("nowhere"), ())


@pytest.fixture(scope="module")
def planted() -> Iterator[Worker]:
    with Worker(NOWHERE, memory_mb=MEGABYTES // 2, readers=readers) as process:
        yield process


@pytest.mark.parametrize(("order", "kind"), ORDERS.items())
def test_defects_are_told_apart(order: str, kind: str, planted: Worker) -> None:
    result = planted.tried("planted", _said(order))
    assert result.kind == kind, result
    assert kind == READ or result.where
    assert planted.tried("planted", _said("now")).kind == READ  # nothing of it is left


def test_a_hang() -> None:
    with Worker(NOWHERE, hang_s=1.0, readers=readers) as impatient:
        result = impatient.tried("planted", _said("sleep"))
    assert result.kind == HANG
    assert sys.platform == "win32" or "planted.py" in result.detail  # where it hangs


@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_too_much_memory(planted: Worker) -> None:
    assert planted.tried("planted", _said("eat")).kind == MEMORY


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_a_crash(planted: Worker) -> None:
    result = planted.tried("planted", _said("abort"))
    assert (result.kind, result.where.split()[0]) == (CRASH, "SIGABRT")
    assert planted.tried("planted", _said("now")).kind == READ


def test_lines_are_new_once() -> None:
    with Worker(NOWHERE, readers=readers) as process:
        first, second = (process.tried("planted", _said("now")).lines for _ in range(2))
    assert any(line.startswith("units/transcript.py") for line in first)
    assert second == frozenset()


def test_smaller_ones_of_the_same() -> None:
    files = smallest({"a.txt": b"some text, then X, then more"}, lambda files: b"X" in files["a.txt"], 10.0)
    assert files == {"a.txt": b"X"}


def test_a_finding_is_kept(planted: Worker, tmp_path: Path) -> None:
    tally = Tally("planted")
    files = _said("please raise it")
    tally.add(planted.tried("planted", files), files)
    (place,) = keep(tally, planted, tmp_path)
    assert picked_up(place) == _said("raise")
    assert "RuntimeError: planted" in place.with_name(f"{place.name}.trace").read_text(encoding="utf-8")


def test_a_campaign_finds_and_counts(planted: Worker) -> None:
    (reader,) = readers().values()

    def run() -> Tally:
        return campaign(reader, planted, NOWHERE, 3, lambda tally: tally.distinct < 60)

    first, second = run(), run()
    assert first.distinct == 60 <= first.made
    assert sum(first.kinds.values()) == 60
    assert first.kinds == second.kinds


def _said(order: str) -> Files:
    return {"a.txt": order.encode()}
