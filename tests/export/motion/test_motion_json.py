import json

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.export import read_motion, write_motion


@pytest.fixture
def path(tmp_path, generation):
    path = tmp_path / "a.json"
    write_motion(path, generation, source={"file": "Größe.wav"}, model={"engine": "trajectory"})
    return path


def test_the_document_is_as_specified(path, generation):
    document = json.loads(path.read_text(encoding="utf-8"))
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


def test_no_zero_is_negative(path):
    assert "-0.00000" not in path.read_text(encoding="utf-8")


def test_channels_and_units_come_back(path, generation):
    motion, units = read_motion(path)
    assert motion.channels == generation.motion.channels
    assert units == generation.units


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "other"}, "not a motion document"),
        ({"version": 2}, "version 2, this lipmotion reads up to 1: upgrade lipmotion"),
        ({"version": "1"}, "version '1', required 1"),
        ({"version": None}, "version None, required 1"),
        ({"rate_hz": 0}, "rate is 0"),
        ({"rate_hz": "fast"}, "damaged"),
        ({"channels": [{"name": "opening"}]}, "has no 'unit'"),
        ({"channels": []}, "shape"),
        ({"values": [[1.0], [1.0, 2.0]]}, "damaged"),
        ({"values": [1.0, 2.0]}, "shape"),
        ({"values": [[float("nan"), 1.0]]}, "not finite"),
        ({"units": [{"start_s": 0.3, "end_s": 0.1, "phone": "m", "unit": "m"}]}, "before its start"),
        ({"units": 3}, "damaged"),
    ],
)
def test_what_is_wrong_is_said(path, change, message):
    document = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**document, **change}), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_motion(path)


@pytest.mark.parametrize("missing", ["rate_hz", "channels", "units"])
def test_a_missing_part_is_named(path, missing):
    document = json.loads(path.read_text(encoding="utf-8"))
    del document[missing]
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match=f"has no '{missing}'"):
        read_motion(path)
