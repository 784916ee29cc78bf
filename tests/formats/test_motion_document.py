import json
from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.formats import read_motion, write_motion
from lipmotion.types import ReducedVariance


@pytest.fixture
def path(tmp_path, generation):
    path = tmp_path / "a.json"
    write_motion(path, generation, source={"file": "Größe.wav"}, model={"engine": "trajectory"})
    return path


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


WRONG: list[tuple[dict[str, object], str]] = [
    ({"format": "other"}, "not a motion document"),
    ({"version": 2}, "version 2, this lipmotion reads up to 1: upgrade lipmotion"),
    ({"version": "1"}, "version '1', required 1"),
    ({"rate_hz": 0}, "rate is 0"),
    ({"rate_hz": "fast"}, "damaged"),
    ({"channels": [{"name": "opening"}]}, "unit is missing"),
    ({"channels": []}, "shape"),
    ({"values": [[1.0], [1.0, 2.0]]}, "damaged"),
    ({"values": [1.0, 2.0]}, "shape"),
    ({"values": [[float("nan"), 1.0]]}, "not finite"),
    ({"units": [{"start_s": 0.3, "end_s": 0.1, "phone": "m", "unit": "m"}]}, "before its start"),
    ({"units": 3}, "damaged"),
    ({"recognised": 3}, "damaged"),
    ({"recognised": [[0.0, 0.3, "sil"]]}, "damaged"),
    ({"recognised": [[0.0, 0.3, "sil", 1.5]]}, "1.5, required a number from 0 to 1"),
]


def test_what_is_wrong_is_said(path, generation):
    assert read_motion(path)[1] == generation.units
    document = json.loads(path.read_text(encoding="utf-8"))
    for change, message in WRONG:
        path.write_text(json.dumps({**document, **change}), encoding="utf-8")
        with pytest.raises(InputError, match=message):
            read_motion(path)
    for missing in ("rate_hz", "channels", "units"):
        path.write_text(json.dumps({key: document[key] for key in document if key != missing}), encoding="utf-8")
        with pytest.raises(InputError, match=f"{missing} is missing"):
            read_motion(path)


@pytest.fixture
def npz_path(tmp_path, generation):
    npz_path = tmp_path / "a.npz"
    write_motion(npz_path, generation, source={"file": "Größe.wav"}, model={})
    return npz_path


def test_arrays_are_not_rounded_and_plain(npz_path, generation):
    motion, _ = read_motion(npz_path)
    assert (motion.values == generation.motion.values).all()
    assert motion.channels == generation.motion.channels
    with np.load(npz_path, allow_pickle=False) as arrays:
        assert set(arrays) == {"values", "standard_deviations", "document"}
        document = json.loads(str(arrays["document"]))
    assert "values" not in document
    assert document["source"] == {"file": "Größe.wav"}


def test_every_value_has_a_standard_deviation(tmp_path, generation):
    spread = np.random.default_rng(3).uniform(0.01, 4, generation.motion.values.shape)
    npz_path = tmp_path / "b.npz"
    write_motion(npz_path, replace(generation, spread=spread), source={}, model={})
    with np.load(npz_path, allow_pickle=False) as arrays:
        np.testing.assert_allclose(arrays["standard_deviations"], np.sqrt(spread), rtol=1e-6)
    reduced = ReducedVariance(spread[:, :1], np.array([[1.0, 4.0]]))
    write_motion(npz_path, replace(generation, spread=reduced), source={}, model={})
    with np.load(npz_path, allow_pickle=False) as arrays:
        np.testing.assert_allclose(arrays["standard_deviations"], np.sqrt(spread[:, :1] * [1, 4]), rtol=1e-6)
    assert (read_motion(npz_path)[0].values == generation.motion.values).all()
