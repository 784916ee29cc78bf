"""The worker process, with a reader that has planted defects."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fuzz.campaign import CampaignRecord, campaign
from fuzz.findings import keep, smallest
from fuzz.inputs import Files, Good, picked_up
from fuzz.judge import CRASH, ERROR, HANG, IMPLAUSIBLE, LEFT, MEMORY, READ, REFUSED
from fuzz.planted import MEGABYTES, readers
from fuzz.worker import Worker

ORDERS = {"raise": ERROR, "lie": IMPLAUSIBLE, "drop": LEFT, "spoil": LEFT, "refuse": REFUSED, "now": READ}
NOWHERE = Good(Path("nowhere"), ())


@pytest.fixture(scope="module")
def planted() -> Iterator[Worker]:
    with Worker(NOWHERE, memory_mb=MEGABYTES // 2, readers=readers) as process:
        yield process


def test_defects_are_told_apart(planted: Worker) -> None:
    for order, kind in ORDERS.items():
        result = planted.read_input("planted", _input(order))
        assert result.kind == kind, result
        assert kind == READ or result.where
        assert planted.read_input("planted", _input("now")).kind == READ  # the next input is not affected


@pytest.mark.long
def test_a_hang() -> None:
    with Worker(NOWHERE, hang_s=1.0, readers=readers) as impatient:
        result = impatient.read_input("planted", _input("sleep"))
    assert result.kind == HANG
    assert sys.platform == "win32" or "planted.py" in result.detail  # the place of the hang


@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_too_much_memory(planted: Worker) -> None:
    assert planted.read_input("planted", _input("eat")).kind == MEMORY


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_a_crash(planted: Worker) -> None:
    result = planted.read_input("planted", _input("abort"))
    assert (result.kind, result.where.split()[0]) == (CRASH, "SIGABRT")
    assert planted.read_input("planted", _input("now")).kind == READ


def test_lines_are_new_once() -> None:
    with Worker(NOWHERE, readers=readers) as process:
        first, second = (process.read_input("planted", _input("now")).lines for _ in range(2))
    assert any(line.startswith("units/text_normalisation.py") for line in first)
    assert second == frozenset()


def test_smaller_ones_of_the_same() -> None:
    files = smallest({"a.txt": b"some text, then X, then more"}, lambda files: b"X" in files["a.txt"], 10.0)
    assert files == {"a.txt": b"X"}


def test_a_finding_is_kept(planted: Worker, tmp_path: Path) -> None:
    record = CampaignRecord("planted")
    files = _input("please raise it")
    record.add(planted.read_input("planted", files), files)
    (place,) = keep(record, planted, tmp_path)
    assert picked_up(place) == _input("raise")
    assert "RuntimeError: planted" in place.with_name(f"{place.name}.trace").read_text(encoding="utf-8")


def test_a_campaign_finds_and_counts(planted: Worker) -> None:
    (reader,) = readers().values()

    def run() -> CampaignRecord:
        return campaign(reader, planted, NOWHERE, 3, lambda record: record.distinct < 30)

    first, second = run(), run()
    assert first.distinct == 30 <= first.made
    assert sum(first.kinds.values()) == 30
    assert first.kinds == second.kinds


def _input(order: str) -> Files:
    return {"a.txt": order.encode()}
