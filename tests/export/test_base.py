from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.export import MotionFormat, motion_suffix, motion_suffixes, read_motion, readable_suffixes, write_motion
from lipmotion.export.base import MOTION_FORMATS
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


@pytest.fixture
def compound(monkeypatch):
    """A format with a suffix of two parts, which cannot be read, beside the one of its last part."""
    monkeypatch.setitem(MOTION_FORMATS.built_in, "take.csv", f"{__name__}:TAKE")


def _write_take(path, generation, _source, _model):
    path.write_text(f"take of {len(generation.motion.values)}\n")


TAKE = MotionFormat(_write_take)


@pytest.mark.usefixtures("compound")
def test_the_longest_suffix_chooses_the_format(tmp_path, generation):
    names = {"a.take.csv": ".take.csv", "a.b.TAKE.Csv": ".take.csv", "a.mistake.csv": ".csv", "take.csv": ".csv"}
    for name, suffix in names.items():
        assert motion_suffix(Path(name)) == suffix
        text = write(tmp_path / name, generation).read_text()
        assert text.startswith("take of" if suffix == ".take.csv" else "time_s,")


@pytest.mark.usefixtures("compound")
def test_a_format_without_reader_is_not_offered_for_reading(tmp_path, generation):
    assert ".take.csv" in motion_suffixes()
    assert ".take.csv" not in readable_suffixes()
    path = write(tmp_path / "a.take.csv", generation)
    with pytest.raises(InputError, match=r"cannot read motion from '\.take\.csv'; use one of \.json, \.csv, \.npz"):
        read_motion(path)


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
