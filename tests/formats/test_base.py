import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.errors import ExportError, InputError
from lipmotion.formats import (
    MotionFormat,
    base,
    motion_suffix,
    motion_suffixes,
    read_motion,
    readable_suffixes,
    write_motion,
)
from lipmotion.formats.base import MOTION_FORMATS, format_rows, read_members
from lipmotion.types import Channel, Generation, Motion, Timeline

EXACT = (".json", ".csv", ".npz", ".c3d")
"""Formats that hold any channels."""
UNITLESS = (".csv", ".c3d")
"""Formats that hold no phones."""


def write(path: Path, generation: Generation) -> Path:
    write_motion(path, generation, source={"file": "Größe.wav"}, model={"engine": "trajectory"})
    return path


@pytest.mark.parametrize("suffix", EXACT)
def test_motion_comes_back(tmp_path, generation, suffix):
    """With any rate, from a name in capitals, and in the same bytes every time."""
    for rate_hz in (25.0, 29.97, 100.0):
        moved = replace(generation, motion=replace(generation.motion, rate_hz=rate_hz))
        paths = [write(tmp_path / f"{name}{suffix.upper()}", moved) for name in "ab"]
        motion, units = read_motion(paths[0])
        assert (motion.names, motion.rate_hz) == (generation.motion.names, rate_hz)
        assert np.abs(motion.values - generation.motion.values).max() <= 5.1e-6
        assert len(units) == (0 if suffix in UNITLESS else 2)
        assert paths[0].read_bytes() == paths[1].read_bytes()
    if suffix in (".json", ".npz"):
        nothing = replace(generation, motion=Motion(np.zeros((0, 2)), 100.0, motion.channels), units=Timeline(()))
        assert read_motion(write(tmp_path / f"none{suffix}", nothing))[0].values.shape == (0, 2)


def _write_take(path, generation, _source, _model):
    path.write_text(f"take of {len(generation.motion.values)}\n")


TAKE = MotionFormat(_write_take)


def test_the_longest_suffix_chooses_the_format_and_one_without_reader_is_not_offered(tmp_path, generation, monkeypatch):
    """A format with a suffix of two parts, which cannot be read, beside the one of its last part."""
    monkeypatch.setitem(MOTION_FORMATS.built_in, "take.csv", f"{__name__}:TAKE")
    names = {"a.take.csv": ".take.csv", "a.b.TAKE.Csv": ".take.csv", "a.mistake.csv": ".csv", "take.csv": ".csv"}
    for name, suffix in names.items():
        assert motion_suffix(Path(name)) == suffix
        text = write(tmp_path / name, generation).read_text()
        assert text.startswith("take of" if suffix == ".take.csv" else "time_s,")
    assert ".take.csv" in motion_suffixes()
    assert ".take.csv" not in readable_suffixes()
    with pytest.raises(InputError, match=r"cannot read motion from '\.take\.csv'; use one of \.json, \.csv, \.npz"):
        read_motion(tmp_path / "a.take.csv")


def test_an_unknown_suffix_names_the_known_ones(tmp_path, generation):
    for name, found in (("a.fbx", "'.fbx'"), ("a", "without a suffix")):
        with pytest.raises(ExportError, match=rf"{found}.*\.json, \.csv, \.npz"):
            write(tmp_path / name, generation)
        with pytest.raises(InputError, match=rf"{found}.*\.json, \.csv, \.npz"):
            read_motion(tmp_path / name)
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", EXACT)
def test_values_that_are_not_finite_are_not_written(tmp_path, generation, suffix):
    broken = Motion(np.array([[0.0], [np.nan]]), 100.0, (Channel("opening"),))
    with pytest.raises(ExportError, match="not finite"):
        write(tmp_path / f"a{suffix}", replace(generation, motion=broken))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", EXACT)
def test_an_old_file_survives_a_failure(tmp_path, generation, suffix, monkeypatch):
    path = write(tmp_path / f"a{suffix}", generation)
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(ExportError, match="No space left"):
        write(path, generation)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", readable_suffixes())
def test_a_missing_and_a_damaged_file_are_named(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    with pytest.raises(InputError, match=rf"a\{suffix}: cannot be read: No such file"):
        read_motion(path)
    for rubbish in (b"", b"\x00\xff\xfe", b"[1, 2]", b"time_s\n", b"{}"):
        path.write_bytes(rubbish)
        with pytest.raises(InputError, match=rf"a\{suffix}: "):
            read_motion(path)


def test_rows_are_the_rounded_values(monkeypatch):
    for block, precision in ((1, "f4"), (7, "f8"), (50, "f8"), (2000, "f4")):
        monkeypatch.setattr(base, "BLOCK_ROWS", block)
        values = np.random.default_rng(0).normal(0, 3, (50, 7)).astype(precision)
        parsed = np.array([[float(number) for number in row.split(",")] for row in format_rows(values)])
        assert (parsed == np.round(values.astype(float), 5)).all()
    plain = ["0.00000,0.00000,0.00000,0.00001,123456.00000"]
    assert list(format_rows(np.array([[0.0, -0.0, -1e-7, 1e-5, 123456.0]]))) == plain
    assert list(format_rows(np.zeros((0, 3)))) == []


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
