"""The worker process, with a reader that has planted defects, its judgement, and the report."""

import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from fuzz.campaign import CampaignRecord, campaign
from fuzz.inputs import Files, Good, Reader, picked_up
from fuzz.judge import CRASH, ERROR, IMPLAUSIBLE, LEFT, MEMORY, READ, REFUSED, Result, read_result
from fuzz.planted import MEGABYTES, readers, seeds
from fuzz.worker import Worker

ORDERS = {"raise": ERROR, "lie": IMPLAUSIBLE, "drop": LEFT, "spoil": LEFT, "refuse": REFUSED, "now": READ}
NOWHERE = Good(Path("nowhere"), ())


@pytest.fixture(scope="module")
def planted() -> Iterator[Worker]:
    with Worker(NOWHERE, memory_mb=MEGABYTES // 2, readers=readers) as process:
        yield process


def test_defects_are_told_apart(planted):
    for order, kind in ORDERS.items():
        result = planted.read_input("planted", _input(order))
        assert result.kind == kind, result
        assert kind == READ or result.where
        assert planted.read_input("planted", _input("now")).kind == READ  # the next input is not affected


@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_too_much_memory(planted):
    assert planted.read_input("planted", _input("eat")).kind == MEMORY


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_a_crash(planted):
    result = planted.read_input("planted", _input("abort"))
    assert (result.kind, result.where.split()[0]) == (CRASH, "SIGABRT")
    assert planted.read_input("planted", _input("now")).kind == READ


def test_a_finding_is_kept(planted, tmp_path):
    record = CampaignRecord("planted")
    result = planted.read_input("planted", _input("raise"))
    record.firsts[result.kind, result.where] = (result, _input("raise"))
    (place,) = record.keep(tmp_path)
    assert picked_up(place) == _input("raise")
    assert "RuntimeError: planted" in place.with_name(f"{place.name}.trace").read_text(encoding="utf-8")


def test_a_campaign_is_the_same_again(planted):
    (reader,) = readers().values()
    one, other = (campaign(reader, planted, NOWHERE, 3, lambda record: record.kinds.total() < 30) for _ in range(2))
    assert one.kinds == other.kinds
    assert one.kinds.total() == 30


def _input(order: str) -> Files:
    return {"a.txt": order.encode()}


FILES: Files = {"a.txt": b"x"}


def read_with(error: Exception, folder: Path) -> Result:
    def read(*_: object) -> None:
        raise error

    return read_result(Reader("planted", seeds, read), FILES, folder / "bad", NOWHERE)


def test_memory_and_warnings_are_defects(tmp_path):
    def warn(*_: object) -> None:
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)

    assert read_with(MemoryError("no room"), tmp_path).kind == MEMORY
    assert read_result(Reader("planted", seeds, warn), FILES, tmp_path / "bad", NOWHERE).kind == ERROR
