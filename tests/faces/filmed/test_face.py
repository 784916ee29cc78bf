import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import ExportError, ModelFormatError
from lipmotion.storage.archive import read_archive, read_archive_header, write_archive
from lipmotion_faces.appearance.person import APPEARANCE, PARTS
from lipmotion_faces.coded_video import STORED_VIDEO
from lipmotion_faces.filmed.face import BACKGROUND, TAKE, FilmedFace, load_face, save_face
from pipeline.damage import DAMAGES, UNREADABLE, damaged

CODED = ("appearance/mouths", "appearance/jaws", "background/data")
"""Arrays of compressed pictures: their bytes are judged by the decoder."""


@pytest.fixture(scope="module")
def small(filmed_face: FilmedFace) -> FilmedFace:
    """A face with few candidates, which is written and read in no time."""
    whole, names = filmed_face.appearance, ("mouths", "mouth_codes", "mouth_distances", "jaws", "jaw_codes")
    candidates = {name: getattr(whole, name)[:8] for name in names}
    return replace(filmed_face, appearance=replace(whole, **candidates))


@pytest.fixture(scope="module")
def arrays(small: FilmedFace, tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    path = tmp_path_factory.mktemp("small") / "small.face"
    save_face(small, path)
    return read_archive(path)


@pytest.fixture(scope="module")
def header(filmed_face_file: Path) -> dict[str, object]:
    found: dict[str, object] = read_archive_header(filmed_face_file)
    return found


def refusal(path: Path, header: dict[str, object], arrays: dict[str, np.ndarray]) -> str:
    """Return the message with which a face of these arrays is refused; empty: it is read."""
    write_archive(path, header, arrays, compressed=False)
    try:
        load_face(path)
    except ModelFormatError as error:
        message = str(error)
        assert message.startswith(f"{path}: ")
        assert "\n" not in message
        return message
    return ""


def test_there_and_back(filmed_face: FilmedFace, filmed_face_file: Path) -> None:
    again = load_face(filmed_face_file)
    assert filmed_face_file.stat().st_size < 5_000_000
    assert again.about == filmed_face.about
    assert again.summary == filmed_face.summary
    assert again.appearance.shape == filmed_face.appearance.shape
    motion = filmed_face.takes[0].motion
    codes, expected = again.appearance.predict_codes(motion), filmed_face.appearance.predict_codes(motion)
    for name in ("mouth", "jaw", "chin_px"):
        assert np.array_equal(getattr(codes, name), getattr(expected, name))
    for name in ("mouths", "jaws"):
        pictures, original = (getattr(face.appearance, name).astype("i2") for face in (again, filmed_face))
        assert np.abs(pictures - original).mean() < 1.5  # coded
    assert np.array_equal(again.appearance.mouth_codes, filmed_face.appearance.mouth_codes)
    assert np.array_equal(again.background.video.data, filmed_face.background.video.data)
    assert np.array_equal(again.background.face_to_frame, filmed_face.background.face_to_frame)
    assert np.array_equal(again.background.chin_px, filmed_face.background.chin_px)
    for take, stored in zip(filmed_face.takes, again.takes, strict=True):
        assert stored.sound.rate_hz == take.sound.rate_hz
        np.testing.assert_allclose(stored.sound.samples, take.sound.samples, rtol=0, atol=1e-4, equal_nan=False)
        np.testing.assert_allclose(stored.motion.values, take.motion.values, rtol=0, atol=1e-6, equal_nan=False)
        assert (stored.motion.channels, stored.motion.rate_hz) == (take.motion.channels, take.motion.rate_hz)
        assert np.array_equal(stored.seen, take.seen)


def test_the_same_face_is_the_same_file(small: FilmedFace, arrays: dict[str, np.ndarray], tmp_path: Path) -> None:
    save_face(small, tmp_path / "again.face")
    again = read_archive(tmp_path / "again.face")
    assert [name for name in arrays if not np.array_equal(arrays[name], again[name])] == []
    save_face(replace(small, takes=()), tmp_path / "mute.face")
    assert load_face(tmp_path / "mute.face").takes == ()


def test_nothing_is_left_where_it_cannot_be_written(small: FilmedFace, tmp_path: Path) -> None:
    with pytest.raises(ExportError):
        save_face(small, tmp_path / "missing" / "a.face")
    (tmp_path / "a.face").write_text("older")
    broken = replace(small, about={"name": object()})
    with pytest.raises(TypeError):
        save_face(broken, tmp_path / "a.face")
    assert [path.name for path in tmp_path.iterdir()] == ["a.face"]
    assert (tmp_path / "a.face").read_text() == "older"


def test_every_array_is_declared(arrays: dict[str, np.ndarray], header: dict[str, object], tmp_path: Path) -> None:
    named = {f"appearance/{name}" for name in APPEARANCE}
    named |= {f"background/{name}" for name in (*BACKGROUND, *STORED_VIDEO)}
    named |= {f"take{number}/{name}" for number in range(2) for name in TAKE}
    parts = tuple(f"appearance/{part}/" for part in PARTS)
    assert {name for name in arrays if not name.startswith(parts)} == named
    assert all(any(name.startswith(part) for name in arrays) for part in parts)
    for more in "appearance/more appearance/noise/more background/more take0/more take2/sound jaw/mean".split():
        message = refusal(tmp_path / "a.face", header, arrays | {more: np.zeros(3)})
        assert "undeclared '" in message
        assert more.rpartition("/")[2] in message


@pytest.mark.long
def test_damaged_arrays_are_refused(arrays: dict[str, np.ndarray], header: dict[str, object], tmp_path: Path) -> None:
    chosen = {damage: DAMAGES[damage] for damage in UNREADABLE}
    small = {name: array for name, array in arrays.items() if name not in CODED and array.dtype.kind in "fiub"}
    read, tried = [], 0
    for name, what, changed in damaged(small, chosen):
        tried += 1
        if not refusal(tmp_path / "a.face", header, {**arrays, name: changed[name]}):
            read.append(f"{name}: {what}")
    assert tried > 100
    # sound and which frames were seen may be of any length, but for the frames of the motion beside them
    assert read == [f"take{number}/sound: a row less" for number in range(2)]


def test_damaged_pictures_are_refused_or_shown(
    arrays: dict[str, np.ndarray], header: dict[str, object], tmp_path: Path
) -> None:
    """A stream whose frames are not all there is refused before anything is shown of it."""
    for name in CODED:
        data = arrays[name]
        noise = np.random.default_rng(0).integers(0, 256, len(data), np.uint8)
        for changed in (data[: len(data) // 2], data[:0], noise, np.concatenate([data, data]), data.astype(np.float32)):
            assert "damaged" in refusal(tmp_path / "a.face", header, arrays | {name: changed})
        refusal(tmp_path / "a.face", header, arrays | {name: data[1:]})  # the start code may lack its zero


def test_faces_of_before(arrays: dict[str, np.ndarray], header: dict[str, object], tmp_path: Path) -> None:
    """Without the distances of candidates, and with a background of one part."""
    former = {name: array for name, array in arrays.items() if not name.endswith(("/mouth_distances", "/cuts"))}
    path = tmp_path / "former.face"
    assert not refusal(path, header, former)
    face = load_face(path)
    assert (face.appearance.mouth_distances, face.background.cuts) == (None, ())
    save_face(face, path)
    assert len(face.appearance.predict_codes(load_face(path).takes[0].motion)) > 0


UNFIT = json.loads(Path(__file__).with_name("unfit_faces.json").read_text("utf-8"))


def test_arrays_and_headers_that_do_not_fit_together(
    arrays: dict[str, np.ndarray], header: dict[str, object], tmp_path: Path
) -> None:
    for row in UNFIT:
        changed = {row["array"]: np.full(row["shape"], row["value"], row["type"])} if "array" in row else {}
        found = refusal(tmp_path / "a.face", header | row.get("header", {}), arrays | changed)
        assert re.search(row["words"], found), row["name"]
