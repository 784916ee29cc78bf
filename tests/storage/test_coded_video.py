from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.storage.archive import read_archive, write_archive
from lipmotion_faces import coded_video


def film(count: int = 21, size: tuple[int, int] = (48, 64)) -> np.ndarray:
    """A soft pattern that moves and changes its brightness [shape=(T, H, W, 3)]."""
    y, x = np.mgrid[: size[0], : size[1]]
    frames = [
        np.stack([110 + 60 * np.sin((x + 2 * n + 9 * colour) / 9) * np.cos(y / 7) + 2 * n for colour in range(3)], -1)
        for n in range(count)
    ]
    return np.clip(frames, 0, 255).astype(np.uint8)


def psnr_db(first: np.ndarray, other: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.square(first.astype(float) - other).mean()))


@pytest.fixture(scope="module")
def stored():
    return coded_video.encode_video(film(), 25.0)


def test_frames_come_back_in_order(stored):
    frames = np.stack(list(stored.decode(range(21))))
    assert len(stored) == stored.count == 21
    assert frames.dtype == np.uint8
    assert min(psnr_db(a, b) for a, b in zip(film(), frames, strict=True)) > 36
    neighbours = [psnr_db(a, b) for a, b in zip(film()[1:], frames, strict=False)]
    assert max(neighbours) < 32  # so each is the right one


@pytest.mark.parametrize("order", [range(20, -1, -1), [7, 8, 7, 20, 0, 15, 16], [3] * 4, []])
def test_any_order_gives_the_same_frames(stored, order):
    whole = list(stored.decode(range(21)))
    frames = list(stored.decode(order))
    assert len(frames) == len(order)
    for n, frame in zip(order, frames, strict=True):
        np.testing.assert_array_equal(frame, whole[n])


def test_odd_sizes():
    for size in ((47, 64), (48, 63), (17, 19)):
        frames = film(3, size)
        shown = np.stack(list(coded_video.encode_video(frames, 25.0).decode(range(3))))
        assert shown.shape == frames.shape
        assert psnr_db(shown, frames) > 34
        pictures = coded_video.decode_pictures(coded_video.encode_pictures(frames))
        assert pictures.shape == frames.shape
        assert psnr_db(pictures, frames) > 40


def test_an_archive_holds_it(stored, tmp_path: Path):
    path = tmp_path / "a.face"
    write_archive(path, {}, coded_video.stored_video_to_arrays(stored))
    read = coded_video.stored_video_from_arrays(read_archive(path))
    assert (read.rate_hz, read.size, read.count) == (25.0, (48, 64), 21)
    np.testing.assert_array_equal(next(read.decode([9])), next(stored.decode([9])))


def test_pictures_keep_their_colours():
    pictures = np.zeros((6, 32, 40, 3), np.uint8)
    pictures[:, :, 0::2] = (200, 40, 40)  # columns of different colours, which 4:2:0 would mix
    pictures[:, :, 1::2] = (40, 80, 200)
    assert psnr_db(coded_video.decode_pictures(coded_video.encode_pictures(pictures, crf=8)), pictures) > 40


def test_what_is_no_video_is_refused():
    for frames, told in (
        ([], "no frames"),
        ([np.zeros((8, 8), np.uint8)], r"shape \(8, 8\), required \(H, W, 3\)"),
        ([np.zeros((32, 32, 3), np.uint8), np.zeros((32, 34, 3), np.uint8)], "frame 1 is uint8"),
        ([np.zeros((32, 32, 3))], "frame 0 is float64"),
    ):
        with pytest.raises(InputError, match=told):
            coded_video.encode_video(frames, 25.0)  # type: ignore[arg-type]
    for options in ({"crf": -1}, {"crf": 52}, {"group": 0}):
        with pytest.raises(InputError, match="required 0 to 51"):
            coded_video.encode_video(film(2), 25.0, **options)
    with pytest.raises(InputError, match="at least one"):
        coded_video.encode_pictures(np.zeros((0, 8, 8, 3), np.uint8))


class TestDamage:
    """Every byte may be wrong: a frame, or ModelFormatError, and nothing else."""

    @pytest.mark.parametrize("change", ["flip", "cut", "zeros", "swap"])
    @pytest.mark.parametrize("seed", range(2))
    def test_changed_bytes(self, stored, change, seed):
        draw = np.random.default_rng(seed)
        data = stored.data.copy()
        at = int(draw.integers(len(data)))
        if change == "flip":
            data[draw.integers(len(data), size=20)] ^= draw.integers(1, 256, size=20).astype(np.uint8)
        elif change == "cut":
            data = data[:at]
        elif change == "zeros":
            data[at : at + 50] = 0
        else:
            data = np.roll(data, at)
        with suppress(ModelFormatError):
            assert {frame.shape for frame in replace(stored, data=data).decode(range(21))} == {(48, 64, 3)}
        with suppress(ModelFormatError):
            assert coded_video.decode_pictures(data).shape[1:] == (48, 64, 3)

    @pytest.mark.parametrize("data", [b"", b"\0\0\1", bytes(400), b"\0\0\1\x09" * 200, b"noise" * 50])
    def test_other_bytes(self, stored, data):
        values = np.frombuffer(data, np.uint8)
        with pytest.raises(ModelFormatError, match="damaged"):
            replace(stored, data=values)
        with pytest.raises(ModelFormatError, match="damaged"):
            coded_video.decode_pictures(values)

    def test_another_count_or_size(self, stored):
        with pytest.raises(ModelFormatError, match="21 frames, required 20"):
            replace(stored, count=20)
        with pytest.raises(ModelFormatError, match="64 × 48 pixels, required 64 × 40"):
            list(replace(stored, size=(40, 64)).decode([0]))

    def test_arrays_of_wrong_kinds(self, stored):
        arrays = coded_video.stored_video_to_arrays(stored)
        for wrong in (
            {name: value for name, value in arrays.items() if name != "size"},
            arrays | {"more": np.zeros(3)},
            arrays | {"data": arrays["data"].astype(float)},
            arrays | {"size": np.array([9000, 9000])},
            arrays | {"rate_hz": np.array(np.nan)},
        ):
            with pytest.raises(ModelFormatError):
                coded_video.stored_video_from_arrays(wrong)

    def test_larger_pictures_than_allowed_are_not_decoded(self, monkeypatch):
        data = coded_video.encode_pictures(film(4))
        monkeypatch.setattr(coded_video, "MAX_PICTURE_BYTES", 4 * 48 * 64 * 3 - 1)
        with pytest.raises(ModelFormatError, match="4 pictures of 9216 bytes"):
            coded_video.decode_pictures(data)


STARTS = [0, 4, 8, 12, 16, 18]


class Film:
    """Frames that know their number, and how often they were read."""

    def __init__(self) -> None:
        self.read: list[tuple[int, int]] = []

    def frames(self, start: int, stop: int) -> list[np.ndarray]:
        self.read.append((start, stop))
        return [np.full((10, 10, 3), n % 256, np.uint8) for n in range(start, stop)]


@pytest.mark.parametrize(
    "order", [range(18), range(17, -1, -1), [5, 17, 0, 5, 6, 16, 4], [*range(18), *range(16, 0, -1)]]
)
@pytest.mark.parametrize("max_bytes", [0, 3 * 4 * 300, 10**6])
def test_every_frame_is_the_right_one(order, max_bytes):
    groups = coded_video.FrameGroups(Film().frames, STARTS, max_bytes)
    assert [int(groups.decode(n)[0, 0, 0]) for n in order] == list(order)


def test_frames_are_read_once_each_way_and_memory_is_bounded():
    film = Film()
    groups = coded_video.FrameGroups(film.frames, STARTS, 0)
    for n in [*range(18), *range(16, -1, -1)]:
        groups.decode(n)
    ways = [(0, 4), (4, 8), (8, 12), (12, 16), (16, 18)]
    assert film.read == [*ways, *ways[2::-1]]  # the last two were still there
    long, sizes = coded_video.FrameGroups(film.frames, range(0, 401, 4), max_bytes=3 * 4 * 300), []
    for n in range(400):
        long.decode(n)
        sizes.append(long.nbytes)
    assert max(sizes) == 3 * 4 * 300
    assert len(groups) == 18
    for index in (-1, 18, 100):
        with pytest.raises(IndexError, match=rf"frame {index} of 18"):
            groups.decode(index)
