from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lipmotion import errors
from lipmotion.units.phones import BLAIR
from lipmotion_faces import Staging
from lipmotion_faces.cut_out import read_cut_out

LETTERS = "ABCDEFGHX"


def draw(folder: Path, names: str, size: tuple[int, int] = (20, 30)) -> Path:
    """Write a picture of one grey for each name; half of it is transparent."""
    folder.mkdir(exist_ok=True)
    for number, name in enumerate(names.split()):
        pixels = np.full((size[1], size[0], 4), 10 * number + 10, np.uint8)
        pixels[:, :, 3] = 255
        pixels[: size[1] // 2, :, 3] = 0
        Image.fromarray(pixels).save(folder / f"{name}.png")
    return folder


def test_letters_and_what_stands_before_them(tmp_path: Path) -> None:
    found = read_cut_out(draw(tmp_path, " ".join(f"anna_{name}" for name in LETTERS) + " notes"))
    assert "".join(found.pictures) == LETTERS
    assert [int(picture[-1, 0, 0]) for picture in found.pictures.values()] == list(range(10, 100, 10))
    assert read_cut_out(draw(tmp_path / "six", "a b c d mouth-e f")).pictures.keys() == {*"ABCDEF"}


def test_names_of_preston_blair(tmp_path: Path) -> None:
    found = read_cut_out(draw(tmp_path, "MBP etc E AI O WQ FV L rest"))
    assert "".join(BLAIR[name] for name in "mbp etc e ai o wq fv l rest".split()) == "".join(found.pictures)
    assert read_cut_out(draw(tmp_path, "MBP etc E AI O WQ FV L rest U")).pictures["F"][-1, 0, 0] == 100


def test_frames_have_the_size_and_the_background_that_is_asked_for(tmp_path: Path) -> None:
    drawn = read_cut_out(draw(tmp_path, " ".join(LETTERS), (21, 31)))
    (white,) = drawn.draw("A", Staging())
    assert white.shape == (32, 22, 3)
    assert (white[0, 5].tolist(), white[-1, 5].tolist()) == ([255] * 3, [10] * 3)
    (green,) = drawn.draw("A", Staging(background="#00ff00", size=62 + 2))
    assert green.shape == (64, 44, 3)
    assert green[0, 5].tolist() == [0, 255, 0]
    clear = list(drawn.draw("AB", Staging(background="transparent")))
    assert [picture.shape for picture in clear] == [(32, 22, 4)] * 2
    assert clear[1][0, 5, 3] == 0


def test_the_base_is_beneath_all(tmp_path: Path) -> None:
    draw(tmp_path, " ".join(LETTERS))
    Image.new("RGB", (20, 30), (200, 100, 50)).save(tmp_path / "Base.jpg", quality=100)
    drawn = read_cut_out(tmp_path)
    assert drawn.pictures["X"][0, 0].tolist() == pytest.approx([200, 100, 50, 255], abs=3)
    assert drawn.pictures["X"][-1, 0].tolist() == [90, 90, 90, 255]


WHOLE = "A B C D E F"
DAMAGES: list[tuple[str, Callable[[Path], object], str]] = [
    ("A B D E", Path.exists, r"no picture of the mouth shapes C F; required: C\.png F\.png"),
    ("A B C D E F x-A", Path.exists, r"x-A\.png: a second picture of the mouth shape A, beside A\.png; keep one"),
    (WHOLE, lambda path: draw(path, "F", (22, 30)), r"F\.png: the pictures are 20 × 30 and 22 × 30 pixels"),
    (WHOLE, lambda path: (path / "D.png").write_bytes(b"\x89PNG no"), r"D\.png: no picture that can be read"),
    (WHOLE, lambda path: Image.new("L", (4097, 2)).save(path / "B.png"), r"B\.png: 4097 × 2 pixels, required at most"),
]


@pytest.mark.parametrize(("names", "damage", "message"), DAMAGES)
def test_folders_that_cannot_be_a_character(
    tmp_path: Path, names: str, damage: Callable[[Path], object], message: str
) -> None:
    damage(draw(tmp_path, names))
    with pytest.raises(errors.InputError, match=message):
        read_cut_out(tmp_path)
