from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.formats import base
from lipmotion.formats.base import read_members

PLAIN = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-(10**9), 10**9), st.floats(allow_nan=False), st.text(max_size=5)),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=3), inner, max_size=3)),
    max_leaves=8,
)


@given(document=st.dictionaries(st.text(max_size=4), PLAIN, max_size=5), indent=st.sampled_from([None, 1, "\t"]))
def test_what_is_no_row_is_read_as_json_reads_it(document: dict[str, Any], indent: Any) -> None:
    text = json.dumps(document, indent=indent, ensure_ascii=False)
    assert read_members(f" {text}\n", "the rows") == json.loads(text)


@given(st.lists(st.lists(st.floats(allow_nan=False), min_size=2, max_size=2), max_size=5), st.sampled_from([None, 1]))
def test_rows_become_an_array(rows: list[list[float]], indent: int | None) -> None:
    found = read_members(json.dumps({"a": 1, "values": rows, "b": []}, indent=indent), "values")
    assert (found["a"], found["b"]) == (1, [])
    assert found["values"].dtype == np.float64
    assert found["values"].tolist() == rows


def test_what_is_no_json_and_rows_of_other_things_are_refused() -> None:
    for text in ("", "{", "[1]", '{"a"}', '{"a":}', '{"a": 1,}', '{"a": [1,]}', '{"a": [1 2]}', '{"a": 1} 2', "{a: 1}"):
        with pytest.raises(json.JSONDecodeError):
            read_members(text, "values")
    for rows in ("[[1], [1, 2]]", "[1, 2]", "[[]]", '[["a"]]', "[[null]]", "[[[1]]]", f"[[1{'0' * 400}]]"):
        with pytest.raises((ValueError, TypeError, OverflowError)) as caught:
            read_members(f'{{"values": {rows}}}', "values")
        assert not isinstance(caught.value, json.JSONDecodeError)


def test_lists_have_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base, "MAX_ITEMS", 3)
    monkeypatch.setattr(base, "MAX_ROWS", 3)
    assert read_members('{"units": [1, 2, 3], "values": [[1], [2], [3]]}', "values")["units"] == [1, 2, 3]
    with pytest.raises(ValueError, match="a list of more than 3 items"):
        read_members('{"units": [1, 2, 3, 4]}', "values")
    monkeypatch.setattr(base, "MAX_ROWS", 4)
    assert read_members('{"units": [1, 2, 3, 4]}', "values", "units")["units"] == [1, 2, 3, 4]
    monkeypatch.setattr(base, "MAX_ROWS", 3)
    with pytest.raises(ValueError, match="more than 3 rows of values"):
        read_members('{"values": [[1], [2], [3], [4]]}', "values")
