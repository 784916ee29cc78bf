from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

WriteVideo = Callable[..., Path]


@pytest.fixture
def write_video(tmp_path: Path) -> WriteVideo:
    """Writes a video whose frame n is a flat grey of value 10 · n, or a picture again and again."""

    def write(
        name: str = "clip.mp4",
        ticks: Sequence[int] = range(10),
        size: tuple[int, int] = (64, 48),
        picture: NDArray[np.uint8] | None = None,
        **how: Any,
    ) -> Path:
        from vision.variants import write_frames

        greys = (np.full((size[1], size[0], 3), 10 * n % 256, np.uint8) for n in range(len(ticks)))
        pictures = [*greys] if picture is None else [picture] * len(ticks)
        return write_frames(tmp_path / name, pictures, ticks=ticks, options={"qp": "0"}, **how)

    return write


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Lets the faces of the next video be those that are given."""
    pytest.importorskip("cv2")
    from vision.scripted import script

    return partial(script, monkeypatch)
