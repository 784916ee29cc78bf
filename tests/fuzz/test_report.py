from __future__ import annotations

import json
from pathlib import Path

from fuzz.campaign import CampaignRecord
from fuzz.judge import CRASH, HANG, LEFT, READ, Result
from fuzz.report import table, write_json


def records() -> list[CampaignRecord]:
    first, second = CampaignRecord("audio", made=5, seconds=2.0), CampaignRecord("labels", made=2, seconds=1.0)
    for kind in (READ, CRASH, HANG, LEFT):
        first.add(Result(kind, "somewhere", "a trace"), {"a": b""})
    second.add(Result(READ), {"a": b""})
    return [first, second]


def test_a_table_with_a_sum() -> None:
    head, *rows = (line.split() for line in table(records()).splitlines())
    by_name = {row[0]: dict(zip(head, row, strict=True)) for row in rows}
    assert list(by_name) == ["audio", "labels", "all"]
    assert [by_name["all"][key] for key in ("tried", "distinct", "read", "crashes", "hangs")] == "7 5 2 1 1".split()
    assert (by_name["audio"]["per_s"], by_name["audio"]["errors"], by_name["audio"]["defects"]) == ("2.0", "1", "3")


def test_the_same_as_json(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", records(), 7, 0.5)
    found = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert [one["reader"] for one in found["readers"]] == ["audio", "labels"]
    assert {one["kind"] for one in found["defects"]} == {CRASH, HANG, LEFT}
    assert found["defects"][0]["detail"] == "a trace"
