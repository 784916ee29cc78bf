import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from formats.examples import of_motion
from formats.examples import written as write
from lipmotion.errors import ExportError, InputError
from lipmotion.formats import read_motion
from lipmotion.formats.c3d import BLOCK, MILLIMETRES, C3dFile, read_c3d, to_head_frame, write_c3d
from lipmotion.types import WEIGHT, Channel, Generation, Motion

RNG = np.random.default_rng(11)
POINTS = (61, 291, 13, 14, 152)
FRAMES = 80


@pytest.fixture
def pointed() -> Generation:
    """Motion with five points, a distance that they do not show, and a weight."""
    values = RNG.normal(0, 0.02, (FRAMES, 17)) + np.array([0.1, *np.tile([0.0, -0.8, 0.2], 5), 0.5])
    names = [f"{axis}_{point}" for point in POINTS for axis in "xyz"]
    channels = (Channel("opening"), *map(Channel, names), Channel("mouthPucker", WEIGHT))
    return of_motion(Motion(values, 100.0, channels))


@pytest.fixture
def written(pointed: Generation, tmp_path: Path) -> Path:
    return write(tmp_path / "a.c3d", pointed)


def test_motion_comes_back(pointed, written):
    motion, units = read_motion(written)
    assert (motion.rate_hz, len(units)) == (100.0, 0)
    assert set(motion.channels) == set(pointed.motion.channels)
    for name in motion.names:
        np.testing.assert_allclose(motion[name], pointed.motion[name], atol=2e-7)


def test_others_read_what_is_written(pointed, written):
    ezc3d, c3d = pytest.importorskip("ezc3d"), pytest.importorskip("c3d")
    theirs = ezc3d.c3d(str(written))
    labels = theirs["parameters"]["POINT"]["LABELS"]["value"]
    assert labels == ["LIP_61", "LIP_291", "LIP_13", "LIP_14", "JAW_152", "EYE_L", "EYE_R"]
    assert theirs["parameters"]["POINT"]["UNITS"]["value"] == ["mm"]
    assert theirs["parameters"]["POINT"]["RATE"]["value"] == [100.0]
    places = np.stack([[pointed.motion[f"{axis}_{point}"] for point in POINTS] for axis in "xyz"])
    np.testing.assert_allclose(theirs["data"]["points"][:3, :5], places * MILLIMETRES, atol=1e-5)
    np.testing.assert_allclose(theirs["data"]["analogs"][0, 1], pointed.motion["mouthPucker"], atol=1e-7)
    with written.open("rb") as file:
        reader = c3d.Reader(file)
        frames = np.array([points[:, :3] for _, points, _ in reader.read_frames()])
        assert [label.strip() for label in reader.point_labels] == labels
        assert reader.point_rate == 100.0
    np.testing.assert_allclose(frames[:, :5].transpose(2, 1, 0), places * MILLIMETRES, atol=1e-5)


@pytest.mark.parametrize("program", ["ezc3d", "c3d"])
def test_what_others_write_is_read(tmp_path, program):
    package = pytest.importorskip(program)
    places = RNG.normal(0, 30, (40, 4, 3))
    labels, path = ["EYE_L", "EYE_R", "LIP_13", "LIP_14"], tmp_path / "b.c3d"
    if program == "ezc3d":
        capture = package.c3d()
        capture["parameters"]["POINT"]["RATE"]["value"] = [120.0]
        capture["parameters"]["POINT"]["LABELS"]["value"] = labels
        capture["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
        capture["data"]["points"] = np.concatenate([places.transpose(2, 1, 0), np.ones((1, 4, 40))])
        capture.write(str(path))
    else:
        writer = package.Writer(point_rate=120)
        writer.set_point_labels(labels)
        nothing = np.zeros((4, 2))
        writer.add_frames([(np.concatenate([frame, nothing], axis=1), np.array([[]])) for frame in places])
        with path.open("wb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            writer.write(file)
    content = read_c3d(path)
    assert (content.labels, content.rate_hz, content.unit) == (tuple(labels), 120.0, "mm")
    np.testing.assert_allclose(content.points, places, atol=1e-5)


def capture(markers: dict[str, np.ndarray], unit: str = "mm") -> C3dFile:
    return C3dFile(tuple(markers), np.stack(list(markers.values()), axis=1), 120.0, unit)


def face() -> dict[str, np.ndarray]:
    """Markers in the head's frame, in eye distances: the eyes and the forehead are still."""
    still = {"Anna:EYE_L": [0.5, 0, 0], "Anna:EYE_R": [-0.5, 0, 0], "Anna:Forehead": [0, 0.5, 0.2]}
    mouth = {"LIP_13": [0, -0.8, 0.3], "LIP_14": [0, -0.85, 0.3], "chin": [0.01, -1.2, 0.1]}
    moved = RNG.normal(0, 0.03, (FRAMES, 3, 3))
    markers = {name: np.tile(np.array(place, float), (FRAMES, 1)) for name, place in still.items()}
    markers |= {name: np.array(p) + moved[:, n] for n, (name, p) in enumerate(mouth.items())}
    return markers | {"Ben:LIP_13": np.full((FRAMES, 3), 9.0)}  # somebody else's, left out


@pytest.mark.parametrize(("unit", "per_mm"), [("mm", 1.0), ("cm", 0.1), ("m", 0.001)])
def test_movements_of_the_head_are_taken_out(tmp_path, unit, per_mm):
    still = face()
    rotations = Rotation.from_euler("xyz", np.cumsum(RNG.normal(0, 0.02, (FRAMES, 3)), axis=0)).as_matrix()
    shift = np.cumsum(RNG.normal(0, 2, (FRAMES, 3)), axis=0)
    moved = {n: (np.einsum("tij,tj->ti", rotations, 88 * p) + shift) * per_mm for n, p in still.items()}
    write_c3d(tmp_path / "a.c3d", capture(moved, unit))
    motion = read_motion(tmp_path / "a.c3d")[0]
    assert motion.names == ("opening", *(f"{axis}_{name}" for name in ("13", "14", "chin") for axis in "xyz"))
    for name, label in (("13", "LIP_13"), ("14", "LIP_14"), ("chin", "chin")):
        place = np.stack([motion[f"{axis}_{name}"] for axis in "xyz"], axis=1)
        # one rotation for all frames remains about the axis x, which nothing but the quarter turn fixes
        np.testing.assert_allclose(np.linalg.norm(place, axis=1), np.linalg.norm(still[label], axis=1), atol=1e-5)
        np.testing.assert_allclose(place[:, 0], still[label][:, 0], atol=1e-5)
    expected = np.linalg.norm(still["LIP_13"] - still["LIP_14"], axis=1)
    np.testing.assert_allclose(motion["opening"], expected, atol=1e-5)


def test_axes_with_z_up_and_faces_that_look_the_other_way_are_turned(tmp_path, caplog):
    still = {name: place for name, place in face().items() if "Ben" not in name}
    z_up = {name: np.stack([p[:, 0], -p[:, 2], p[:, 1]], axis=1) * 90 for name, p in still.items()}
    write_c3d(tmp_path / "a.c3d", capture(z_up))
    motion = read_motion(tmp_path / "a.c3d")[0]
    np.testing.assert_allclose(np.stack([motion[f"{axis}_13"] for axis in "xyz"], axis=1), still["LIP_13"], atol=1e-5)
    behind = {name.split(":")[-1]: p * [-90.0, 90, -90] for name, p in still.items()}
    np.testing.assert_allclose(to_head_frame(behind, "mm")["LIP_13"], still["LIP_13"], atol=1e-9)
    assert not caplog.messages
    to_head_frame({name: p * [-1, 1, 1] for name, p in behind.items()}, "mm")
    assert "eye distances behind the eyes, required in front of them" in caplog.text
    mouth = {name: p * 90 for name, p in still.items() if ":" not in name}  # no eyes: an eye distance is stated
    write_c3d(tmp_path / "a.c3d", capture(mouth))
    np.testing.assert_allclose(read_motion(tmp_path / "a.c3d")[0]["y_chin"], mouth["chin"][:, 1] / 90, atol=1e-6)


def test_gaps_are_bridged_and_lost_markers_left_out(tmp_path):
    markers = face()
    ramp = np.linspace(0.1, 1, FRAMES)
    markers["chin"] = np.stack([ramp, ramp, ramp], axis=1)
    markers["chin"][20:30] = np.nan
    markers["lost"] = np.where(np.arange(FRAMES)[:, None] < 50, np.nan, markers["LIP_13"])
    markers["*7"] = markers["LIP_13"]
    del markers["Anna:EYE_L"]
    write_c3d(tmp_path / "a.c3d", capture(markers, "m"))
    motion = read_motion(tmp_path / "a.c3d")[0]
    np.testing.assert_allclose(motion["x_chin"] * MILLIMETRES / 1000, ramp, atol=1e-6)
    assert not [name for name in motion.names if "lost" in name or "*" in name]


def test_points_as_whole_numbers_are_read(tmp_path):
    places = np.round(RNG.normal(0, 500, (FRAMES, 2, 3)))
    write_c3d(tmp_path / "a.c3d", C3dFile(("one", "two"), places * 0.1, 120.0))
    content = (tmp_path / "a.c3d").read_bytes()
    block = struct.unpack_from("<H", content, 16)[0]
    head = content[: (block - 1) * BLOCK].replace(struct.pack("<f", -1.0), struct.pack("<f", 0.1))
    rows = np.concatenate([places, np.zeros((FRAMES, 2, 1))], axis=2).astype("<i2")
    (tmp_path / "b.c3d").write_bytes(head + rows.tobytes())
    np.testing.assert_allclose(read_c3d(tmp_path / "b.c3d").points, places * 0.1, rtol=1e-6)


DAMAGES = [
    (lambda _: b"x" * 2000, "not a C3D file"),
    (lambda content: content[:1600], "cut short|not a C3D file"),
    (lambda content: content[:-2000], "cut short: .* frames of data, required"),
    (lambda content: content[:515] + b"\x57" + content[516:], "its processor type is 87, required 84 .Intel"),
    (lambda content: content[:2] + b"\xff\xff" + content[4:], "65535 points and"),
    (lambda content: content[:16] + b"\0\0" + content[18:], "cut short"),
    (lambda content: content.replace(b"mm", b"ly").replace(b"lipmotion", b"otherprog"), "its unit of length is 'ly'"),
    (lambda content: content.replace(struct.pack("<f", 100.0), struct.pack("<f", float("nan"))), "rate is nan"),
    (lambda content: content[:800].ljust(512 * 40, b"\1"), "required|again"),
]


def test_what_is_wrong_is_said(tmp_path, written):
    for change, message in DAMAGES:
        (tmp_path / "b.c3d").write_bytes(change(written.read_bytes()))
        with pytest.raises(InputError, match=message):
            read_motion(tmp_path / "b.c3d")


def test_markers_of_the_mouth_are_required(tmp_path):
    still = {name: place for name, place in face().items() if "Anna:" in name}
    eye = still["Anna:EYE_L"]
    for markers, message in (
        (still, "all markers are those of the head"),
        ({"LIP_13": eye, "chin": eye + 0.01}, r"at most 0.01 mm apart, required 18: is its unit of length 'mm' right"),
        ({"*1": eye}, r"no marker with a name is seen in half of the frames; the labels: \*1"),
        ({"EYE_L": eye, "EYE_R": eye, "LIP_13": eye}, "the two eye corners are in one place"),
    ):
        write_c3d(tmp_path / "a.c3d", capture(markers))
        with pytest.raises(InputError, match=message):
            read_motion(tmp_path / "a.c3d")
    with pytest.raises(ExportError, match="does not fit into"):
        write(tmp_path / "d.c3d", of_motion(Motion(np.zeros((2, 1)), 100.0, (Channel("öffnen"),))))


def test_a_header_that_says_another_number_is_named(tmp_path, written, caplog):
    content = written.read_bytes()
    (tmp_path / "b.c3d").write_bytes(content[:8] + b"\xf0\xff" + content[10:])
    assert len(read_motion(tmp_path / "b.c3d")[0].values) == FRAMES
    assert "80 or 65520" in caplog.text


LONG = 70_000


def two_words(number: int) -> bytes:
    return struct.pack("<2H", number % 65_536, number // 65_536)


@pytest.fixture(scope="module")
def long_capture(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """One marker that moves along in 70,000 frames."""
    path = tmp_path_factory.mktemp("long") / "a.c3d"
    write_c3d(path, C3dFile(("LIP_13",), np.arange(1.0, LONG + 1)[:, None, None] * [1, 0, 0], 100.0))
    return path.read_bytes()


TWO = b"\x02\x01\x02"  # what stands before a parameter of two whole numbers
NO_LONG, NO_END = {b"LONG_FRAMES": b"XXXX_FRAMES"}, {b"ACTUAL_END_FIELD": b"XXXXXX_END_FIELD"}


@pytest.mark.parametrize(
    ("change", "warns"),
    [
        ({}, False),
        (NO_LONG, False),  # the header stops at 65,535: TRIAL counts on
        (NO_END, False),  # POINT:LONG_FRAMES alone
        (NO_LONG | NO_END, True),  # nothing but the data
        ({two_words(LONG): two_words(LONG + 9), TWO + two_words(1): TWO + two_words(10), **NO_LONG}, False),
        (NO_LONG | NO_END | {struct.pack("<H", 65_535): struct.pack("<H", LONG - 65_536)}, None),  # it began again
    ],
)
def test_more_frames_than_the_header_counts(tmp_path, long_capture, change, warns, caplog):
    head, data = long_capture[: 3 * BLOCK], long_capture[3 * BLOCK :]
    for old, new in change.items():
        assert old in head
        head = head.replace(old, new)
    (tmp_path / "a.c3d").write_bytes(head + data)
    places = read_c3d(tmp_path / "a.c3d").points[:, 0, 0]
    assert np.isfinite(places).sum() == LONG
    assert places[LONG - 1] == pytest.approx(LONG)
    assert warns is None or ("65535" in caplog.text) == warns
