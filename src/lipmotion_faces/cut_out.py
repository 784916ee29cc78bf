"""A character of pictures: one drawing for each mouth shape of a chart, shown one after another.

The folder has ``A.png`` to ``F.png``, and perhaps ``G.png``, ``H.png`` and ``X.png``, as Rhubarb's chart names them, or
Preston Blair's names (``MBP.png``, ``AI.png``, …); what stands before the name, as in ``anna_A.png``, does not matter.
``base.png`` is drawn beneath all of them.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.units.phones import BLAIR, LETTERS, SHAPES
from lipmotion_faces.base import TRANSPARENT, Staging

Picture = NDArray[np.uint8]
SUFFIXES = (".png", ".webp", ".jpg", ".jpeg")
BASE = "base"
REQUIRED = "".join(name for name, shape in SHAPES.items() if not shape.fallback)
LARGEST_PX, MAX_PIXELS = 4096, 1 << 26  # largest side of a picture, and most pixels of all together
LARGEST_BYTES = 1 << 26
MAX_FILES = 1000
WHITE = (255, 255, 255)
_NAME = re.compile(r"(?:^|[^A-Za-z])([A-Za-z]{1,4})$")


@dataclass(frozen=True, eq=False)
class CutOut:
    """The pictures of a character by mouth shape: RGBA with straight alpha, of one size [each shape=(H, W, 4)]."""

    pictures: Mapping[str, Picture]

    def draw(self, shapes: Iterable[str], staging: Staging) -> Iterator[Picture]:
        """Yield a picture for each shape, RGB or RGBA, of even sizes, with size and background of the staging."""
        staged = {name: _stage(picture, staging) for name, picture in self.pictures.items()}
        for shape in shapes:
            yield staged[shape]


def picture_files(folder: Path) -> list[Path]:
    """Return the pictures in a folder, by their names, in order; at most ``MAX_FILES``."""
    files = [path for path in sorted(folder.iterdir()) if path.suffix.lower() in SUFFIXES and path.is_file()]
    return files[:MAX_FILES]


def read_cut_out(folder: Path) -> CutOut:
    """Return the character of a folder of pictures. Raises InputError: a shape is missing or twice, or sizes differ."""
    files = picture_files(folder)
    named = {path: match[1].lower() for path in files if (match := _NAME.search(path.stem))}
    readings = (_name_shapes(named, names) for names in (LETTERS, BLAIR))
    chosen = max(readings, key=lambda reading: len(reading.keys() & set(REQUIRED)))
    missing = [name for name in REQUIRED if name not in chosen]
    if missing:
        names = " ".join(f"{name}.png" for name in missing)
        raise InputError(f"{folder}: no picture of the mouth shapes {' '.join(missing)}; required: {names}")
    base = next((path for path in files if path.stem.lower() == BASE), None)
    below = None if base is None else _read(base)
    pictures: dict[str, Picture] = {}
    for name in (name for name in LETTERS.values() if name in chosen):
        picture = _read(chosen[name])
        first = next(iter(pictures.values()), picture if below is None else below)
        if picture.shape != first.shape:
            sizes = " and ".join(f"{each.shape[1]} × {each.shape[0]}" for each in (first, picture)) + " pixels large"
            raise InputError(f"{chosen[name]}: the pictures are {sizes}, required one size; export them alike")
        if (len(pictures) + 1) * picture.shape[0] * picture.shape[1] > MAX_PIXELS:
            raise InputError(f"{folder}: the pictures have more than {MAX_PIXELS} pixels together; export them smaller")
        pictures[name] = picture if below is None else _lay_over(picture, below)
    return CutOut(pictures)


def _name_shapes(named: Mapping[Path, str], names: Mapping[str, str]) -> dict[str, Path]:
    """Return the pictures by the letters of their shapes. Raises InputError: two of one shape."""
    shapes: dict[str, Path] = {}
    for path, name in named.items():
        shape = names.get(name)
        if shape is None or (name == "wq" and shape in shapes):
            continue
        if shape in shapes and named[shapes[shape]] != "wq":
            other = shapes[shape].name
            raise InputError(f"{path}: a second picture of the mouth shape {shape}, beside {other}; keep one")
        shapes[shape] = path
    return shapes


def _read(path: Path) -> Picture:
    """Return a picture [shape=(H, W, 4)]. Raises InputError: it is none, or too large."""
    from PIL import Image

    try:
        if path.stat().st_size > LARGEST_BYTES:
            size = path.stat().st_size
            raise InputError(f"{path}: {size} bytes, required at most {LARGEST_BYTES}; export it smaller")
        with Image.open(io.BytesIO(path.read_bytes()), formats=("PNG", "WEBP", "JPEG")) as picture:
            if max(picture.size) > LARGEST_PX:
                raise InputError(f"{path}: {picture.width} × {picture.height} pixels, required at most {LARGEST_PX}")
            return np.array(picture.convert("RGBA"))
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, MemoryError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: no picture that can be read ({error}); export it as PNG") from error


def _lay_over(upper: Picture, lower: Picture) -> Picture:
    """Return a picture over another one, both with straight alpha [shape=(H, W, 4)]."""
    cover, below = upper[..., 3:] / 255, lower[..., 3:] / 255
    alpha = cover + below * (1 - cover)
    colours = upper[..., :3] * cover + lower[..., :3] * below * (1 - cover)
    with np.errstate(invalid="ignore", divide="ignore"):
        mixed = np.where(alpha > 0, colours / alpha, 0)
    return np.rint(np.concatenate([mixed, 255 * alpha], axis=-1)).astype(np.uint8)


def _stage(picture: Picture, staging: Staging) -> Picture:
    """Return a picture in the size and on the background of a staging."""
    from PIL import Image

    height, width = picture.shape[:2]
    tall = staging.size or max(2, height + height % 2)
    wide = max(2, 2 * round(width * tall / height / 2))
    if (tall, wide) != (height, width):
        premultiplied = Image.fromarray(picture).convert("RGBa")
        picture = np.array(premultiplied.resize((wide, tall), Image.Resampling.LANCZOS).convert("RGBA"))
    if staging.background == TRANSPARENT:
        return picture
    ground = np.empty_like(picture)
    ground[:] = (*(staging.colour or WHITE), 255)
    return np.ascontiguousarray(_lay_over(picture, ground)[..., :3])
