from pathlib import Path

import numpy as np
import pytest

from lipmotion.corpora.captured_faces import read_bare_motion, read_channels
from lipmotion.corpora.folder import discover
from lipmotion.corpora.source_recordings import MotionFile
from lipmotion.errors import InputError
from lipmotion.types import Channel

NAMES = np.array(["jaw", "smile", "brow"])
CHANNELS = tuple(Channel(name, "weight") for name in NAMES.tolist())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    np.save(tmp_path / "anna_bs_name.npy", NAMES)
    for name in ("one", "two"):
        (tmp_path / f"{name}.wav").touch()
        np.save(tmp_path / f"bs_value_{name}.npy", np.random.default_rng(0).uniform(size=(60, 3)))
    return tmp_path


def test_sounds_with_arrays(folder):
    (folder / "one.txt").write_text("Hello.")
    (folder / "LICENSE").write_text("\nThe MIT License\n\nCopyright (c) Anna\nmore\n")
    (folder / "test.txt").write_text("two\n")
    found = discover(folder)
    assert found.kind == "FACEGOOD blendshape weights"
    read = [(item.name, item.split, item.words) for item in found.recordings]
    assert read == [("one", "train", ("hello",)), ("two", "test", None)]
    one = found.recordings[0]
    assert one.file == folder / "one.wav"
    assert one.motion_file == MotionFile(folder / "bs_value_one.npy", 30.0, CHANNELS)
    assert one.rights == {"licence": "The MIT License", "attribution": "Copyright (c) Anna"}
    motion = read_bare_motion(one.motion_file)
    assert (motion.rate_hz, motion.channels) == (30.0, CHANNELS)
    np.testing.assert_array_equal(motion.values, np.load(folder / "bs_value_one.npy"))
    (folder / "LICENSE").write_text("MIT License\n" + "x" * 20_000 + "\nCopyright (c) nobody\n")
    assert discover(folder).recordings[0].rights == {"licence": "MIT License"}  # of which the beginning is read


def test_an_array_needs_one_sound(folder):
    (folder / "one.wav").rename(folder / "three.wav")
    (folder / "two.flac").touch()
    found = discover(folder)
    assert found.recordings == ()
    assert "0 sounds named one, required one: one.wav" in found.problems["one"]
    assert "2 sounds named two" in found.problems["two"]


def test_a_header_written_by_python_2(folder, recwarn):
    """Its sizes end in L."""
    path = folder / "bs_value_one.npy"
    plain = path.read_bytes()
    old = plain.replace(b"(60, 3)", b"(60L, 3L)").replace(b"  \n", b"\n", 1)
    assert len(old) == len(plain)
    path.write_bytes(old)
    assert read_bare_motion(MotionFile(path, 30.0, CHANNELS)).values.shape == (60, 3)
    assert not recwarn.list


class Harmful:
    """Removes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[Path]]:
        return Path.unlink, (self.path,)


@pytest.mark.parametrize("name", ["anna_bs_name.npy", "bs_value_one.npy"])
def test_nothing_is_unpickled(folder, name):
    victim = folder / "victim"
    victim.touch()
    np.save(folder / name, np.array([Harmful(victim)], object), allow_pickle=True)
    with pytest.raises(InputError, match=r"not an array of numbers or texts .*save it with numpy\.save"):
        read_channels(folder / name) if "name" in name else read_bare_motion(MotionFile(folder / name, 30.0, CHANNELS))
    assert victim.exists()


def test_names_that_are_none(folder):
    twice, text = (np.arange(3.0), np.array(["a", "a", "b"])), "required one row of different texts"
    formulas = (np.array([name, "b", "c"]) for name in ("=1+1", "@SUM(A1)", "\t=1"))
    wrong = [(names, text) for names in twice] + [(names, "begins as a spreadsheet's formula") for names in formulas]
    for names, message in wrong:
        np.save(folder / "anna_bs_name.npy", names)
        with pytest.raises(InputError, match=message):
            discover(folder)
    np.save(folder / "ben_bs_name.npy", NAMES)
    with pytest.raises(InputError, match="2 lists of channel names"):
        discover(folder)


def test_arrays_that_do_not_fit(folder):
    wanted = r"required numbers of shape \(frames, 3\)"
    for values, message in (
        (np.zeros((5, 2)), wanted),
        (np.array([["a", "b", "c"]]), wanted),
        (np.zeros((2, 3), bool), wanted),
        (np.full((5, 3), np.nan), "not finite"),
    ):
        np.save(folder / "bs_value_one.npy", values)
        with pytest.raises(InputError, match=message):
            read_bare_motion(MotionFile(folder / "bs_value_one.npy", 30.0, CHANNELS))
