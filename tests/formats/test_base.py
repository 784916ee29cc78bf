import json
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion import formats
from lipmotion.errors import ExportError, InputError
from lipmotion.formats.base import MOTION_FORMATS, format_rows, read_members
from lipmotion.formats.sound import write_sound
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.resampling import resample_speech
from lipmotion.types import Audio, Channel, Generation, Motion, ReducedVariance, Timeline, from_sixteen_bits

EXACT = (".json", ".csv", ".npz", ".c3d")  # formats that hold any channels
UNITLESS = (".csv", ".c3d")  # formats that hold no phones


def write(path: Path, generation: Generation) -> Path:
    formats.write_motion(path, generation, source={"file": "Größe.wav"}, model={"engine": "trajectory"})
    return path


@pytest.mark.parametrize("suffix", EXACT)
def test_motion_comes_back(tmp_path, generation, suffix):
    """With any rate, from a name in capitals, and in the same bytes every time."""
    for rate_hz in (25.0, 29.97, 100.0):
        moved = replace(generation, motion=replace(generation.motion, rate_hz=rate_hz))
        paths = [write(tmp_path / f"{name}{suffix.upper()}", moved) for name in "ab"]
        motion, units = formats.read_motion(paths[0])
        assert (motion.names, motion.rate_hz) == (generation.motion.names, rate_hz)
        assert np.abs(motion.values - generation.motion.values).max() <= 5.1e-6
        assert len(units) == (0 if suffix in UNITLESS else 2)
        assert paths[0].read_bytes() == paths[1].read_bytes()
    if suffix in (".json", ".npz"):
        nothing = replace(generation, motion=Motion(np.zeros((0, 2)), 100.0, motion.channels), units=Timeline(()))
        assert formats.read_motion(write(tmp_path / f"none{suffix}", nothing))[0].values.shape == (0, 2)


def _write_take(path, generation, _source, _model):
    path.write_text(f"take of {len(generation.motion.values)}\n")


TAKE = formats.MotionFormat(_write_take)


def test_the_longest_suffix_chooses_the_format_and_one_without_reader_is_not_offered(tmp_path, generation, monkeypatch):
    """A format with a suffix of two parts, which cannot be read, beside the one of its last part."""
    monkeypatch.setitem(MOTION_FORMATS.built_in, "take.csv", f"{__name__}:TAKE")
    names = {"a.take.csv": ".take.csv", "a.b.TAKE.Csv": ".take.csv", "a.mistake.csv": ".csv", "take.csv": ".csv"}
    for name, suffix in names.items():
        assert formats.find_suffix(Path(name)) == suffix
        text = write(tmp_path / name, generation).read_text()
        assert text.startswith("take of" if suffix == ".take.csv" else "time_s,")
    assert ".take.csv" in formats.list_suffixes()
    assert ".take.csv" not in formats.list_read_suffixes()
    with pytest.raises(InputError, match=r"cannot read motion from '\.take\.csv'; use one of \.json, \.csv, \.npz"):
        formats.read_motion(tmp_path / "a.take.csv")


def test_an_unknown_suffix_names_the_known_ones(tmp_path, generation):
    for name, found in (("a.fbx", "'.fbx'"), ("a", "without a suffix")):
        with pytest.raises(ExportError, match=rf"{found}.*\.json, \.csv, \.npz"):
            write(tmp_path / name, generation)
        with pytest.raises(InputError, match=rf"{found}.*\.json, \.csv, \.npz"):
            formats.read_motion(tmp_path / name)
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", EXACT)
def test_values_that_are_not_finite_are_not_written(tmp_path, generation, suffix):
    broken = Motion(np.array([[0.0], [np.nan]]), 100.0, (Channel("opening"),))
    with pytest.raises(ExportError, match="not finite"):
        write(tmp_path / f"a{suffix}", replace(generation, motion=broken))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", formats.list_read_suffixes())
def test_a_missing_and_a_damaged_file_are_named(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    with pytest.raises(InputError, match=rf"a\{suffix}: cannot be read: No such file"):
        formats.read_motion(path)
    for rubbish in (b"", b"\x00\xff\xfe", b"[1, 2]", b"time_s\n", b"{}"):
        path.write_bytes(rubbish)
        with pytest.raises(InputError, match=rf"a\{suffix}: "):
            formats.read_motion(path)


def test_rows_are_the_rounded_values():
    for rows, precision in ((50, "f4"), (50, "f8"), (2 * formats.base.BLOCK_ROWS + 7, "f8")):
        values = np.random.default_rng(0).normal(0, 3, (rows, 7)).astype(precision)
        parsed = np.array([[float(number) for number in row.split(",")] for row in format_rows(values)])
        assert (parsed == np.round(values.astype(float), 5)).all()
    plain = ["0.00000,0.00000,0.00000,0.00001,123456.00000"]
    assert list(format_rows(np.array([[0.0, -0.0, -1e-7, 1e-5, 123456.0]]))) == plain
    assert list(format_rows(np.zeros((0, 3)))) == []


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


@pytest.fixture
def path(tmp_path, generation):
    return write(tmp_path / "a.json", generation)


def test_the_document_is_as_specified(path, generation):
    text = path.read_text(encoding="utf-8")
    assert "-0.00000" not in text
    document = json.loads(text)
    values = document.pop("values")
    assert document == {
        "format": "lipmotion.motion",
        "version": 1,
        "rate_hz": 100.0,
        "channels": [{"name": "opening", "unit": "eye_distance"}, {"name": "x_17", "unit": "metre"}],
        "units": [
            {"start_s": 0.0, "end_s": 0.3, "phone": "sil", "unit": "sil"},
            {"start_s": 0.3, "end_s": 0.45, "phone": "m", "unit": "m", "word": "mama"},
        ],
        "source": {"file": "Größe.wav"},
        "model": {"engine": "trajectory"},
    }
    assert values == np.round(generation.motion.values, 5).tolist()


DAMAGED = json.loads(Path(__file__).with_name("damaged_files.json").read_text(encoding="utf-8"))
"""Files of motion and cues, what they hold, and the error; a name of a file comes with several errors."""


@pytest.mark.parametrize("case", DAMAGED, ids=lambda case: f"{case['file']}: {case['error'][:40]}")
def test_damaged_files_are_refused(tmp_path: Path, case: dict[str, str]) -> None:
    (tmp_path / case["file"]).write_bytes(case["content"].encode())
    with pytest.raises(InputError, match=case["error"]):
        formats.read_motion(tmp_path / case["file"])


@pytest.fixture
def npz_path(tmp_path, generation):
    return write(tmp_path / "a.npz", generation)


def test_arrays_are_not_rounded_and_plain(npz_path, generation):
    motion, _ = formats.read_motion(npz_path)
    assert (motion.values == generation.motion.values).all()
    assert motion.channels == generation.motion.channels
    with np.load(npz_path, allow_pickle=False) as arrays:
        assert set(arrays) == {"values", "standard_deviations", "document"}
        document = json.loads(str(arrays["document"]))
    assert "values" not in document
    assert document["source"] == {"file": "Größe.wav"}


def test_every_value_has_a_standard_deviation(tmp_path, generation):
    variance = np.random.default_rng(3).uniform(0.01, 4, generation.motion.values.shape)
    reduced = ReducedVariance(variance[:, :1], np.array([[1.0, 4.0]]))
    for spread, whole in ((variance, variance), (reduced, variance[:, :1] * [1, 4])):
        npz_path = write(tmp_path / "b.npz", replace(generation, spread=spread))
        with np.load(npz_path, allow_pickle=False) as arrays:
            np.testing.assert_allclose(arrays["standard_deviations"], np.sqrt(whole), rtol=1e-6)
        assert (formats.read_motion(npz_path)[0].values == generation.motion.values).all()


RATE_HZ = 22_050


def tone(duration_s: float = 2.0, level: float = 0.5) -> Audio:
    return Audio((level * np.sin(np.arange(round(duration_s * RATE_HZ)) * 0.1)).astype(np.float32), RATE_HZ)


@pytest.mark.parametrize("rate_hz", [16_000, 22_050, 44_100])
def test_sixteen_bits_come_back_as_they_were_and_are_read_so(tmp_path: Path, rate_hz: int) -> None:
    values = np.resize(np.array([-32_768, -32_767, -1, 0, 1, 20_000, 32_766, 32_767], np.int16), 70_000)
    sound = Audio(from_sixteen_bits(values), rate_hz)
    for name in ("a.wav", "a.flac"):
        write_sound(tmp_path / name, sound)
        assert np.array_equal(read_audio(tmp_path / name, rate_hz).samples, sound.samples)
        assert np.array_equal(read_audio(tmp_path / name).samples, resample_speech(sound).samples)


@pytest.mark.parametrize(("name", "level"), [("a.wav", 0.5), ("a.FLAC", 0.5), ("a.wav", 2.0)])
def test_samples_survive_and_too_loud_ones_are_clipped(tmp_path: Path, name: str, level: float) -> None:
    write_sound(tmp_path / name, tone(level=level))
    read = read_audio(tmp_path / name, RATE_HZ)
    np.testing.assert_allclose(read.samples, np.clip(tone(level=level).samples, -1, 1), atol=1e-4)
    with av.open(str(tmp_path / name)) as container:
        assert container.streams.audio[0].rate == RATE_HZ


def test_a_compressed_sound_is_as_long_and_as_loud(tmp_path: Path) -> None:
    write_sound(tmp_path / "a.ogg", tone())
    read = read_audio(tmp_path / "a.ogg", RATE_HZ)
    assert read.duration_s == pytest.approx(2.0, abs=0.03)
    assert np.abs(read.samples[RATE_HZ // 2 : RATE_HZ]).max() == pytest.approx(0.5, abs=0.05)


def test_errors_leave_nothing(tmp_path: Path) -> None:
    for name, audio, message in (
        ("a.mp3", tone(), "unknown format '.mp3'; required one of: .wav .flac .ogg"),
        ("a.wav", Audio(np.zeros(0, np.float32), RATE_HZ), "the sound has no samples"),
        ("no/a.wav", tone(), "the folder .* does not exist"),
    ):
        with pytest.raises(ExportError, match=message):
            write_sound(tmp_path / name, audio)
        assert list(tmp_path.iterdir()) == []
