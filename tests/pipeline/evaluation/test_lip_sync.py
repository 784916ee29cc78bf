from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.export.video import write_mp4
from lipmotion.measures.comparison_table import comparison_table
from lipmotion.pipeline.evaluation.compare import compare
from lipmotion.types import Audio, Channel, Motion
from oracles.syncnet import KERNELS, random_state
from vision.scripted import face, script

FLASHES = (4, 9, 15, 18, 26, 29, 33)
"""Pictures that are white; all others are black."""
PICTURES = 38


def made_state() -> dict[str, Any]:
    """Return weights of a network that sees how bright three pictures in a row are together, and hears how loud it is.

    Every layer hands one value on, from the middle of its kernel; the last one of sounds from the corner.
    """
    state = {name: np.zeros_like(array) for name, array in random_state(1).items()}
    for tower, kernels in KERNELS.items():
        for number, kernel in kernels.items():
            weights = state[f"{tower}.{number}.weight"]
            corner = (0, 0) if (tower, number) == ("netcnnaud", 18) else (kernel[-2] // 2, kernel[-1] // 2)
            times = slice(0, 3) if kernel == (5, 7, 7) else slice(None)
            weights[(0, 0, *([times] if len(kernel) == 3 else []), *corner)] = 1
    for name, array in state.items():
        if f"{name.rpartition('.')[0]}.running_var" in state:
            array[...] = name.endswith((".running_var", ".weight"))
    state["netcnnlip.0.weight"] /= 12  # white is about as bright as noise is loud
    for maps in ("netfclip", "netfcaud"):
        state[f"{maps}.0.weight"][...] = 1
        state[f"{maps}.3.weight"][...] = 1
    return state


def write_flashes(path: Path, late: int, count: int = PICTURES) -> Path:
    """Write a video that flashes, with noise in its sound ``late`` pictures after every flash."""
    pictures = [np.full((240, 200, 3), 255 * (n in FLASHES), np.uint8) for n in range(count)]
    samples = np.zeros(640 * count, np.float32)
    noise = np.random.default_rng(0).normal(size=640) * 0.2
    for flash in FLASHES:
        start = 640 * (flash + late)
        samples[start : start + 640] = noise[: max(len(samples) - start, 0)]
    write_mp4(path, pictures, fps=25, audio=Audio(samples, 16_000))
    return path


def faces(count: int = PICTURES) -> list[np.ndarray]:
    return [face(0.1 + 0.05 * np.sin(n / 3)) + np.array([60, 40, 0]) for n in range(count)]


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    np.savez(tmp_path / "weights.npz", **made_state())
    return tmp_path / "weights.npz"


@pytest.mark.long
def test_the_sound_of_a_made_network_is_as_late_as_it_was_made(
    tmp_path: Path, weights: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("cv2")
    inputs = [write_flashes(tmp_path / f"{late}.mp4", late) for late in (0, 3)]
    script(monkeypatch, faces() * 2)
    figures = compare(*inputs, sync_weights=weights)
    both = (figures["sync"], figures["others"][0]["sync"])
    assert [sync["late_ms"] for sync in both] == pytest.approx([0, 120])
    for sync in both:
        assert sync["vectors"] == PICTURES - 4
        assert sync["confidence"] > sync["distance"]
    lines = [line for line in comparison_table(figures).splitlines() if "lips and sound (SyncNet): confidence" in line]
    assert [line.partition("sound late by ")[2] for line in lines] == ["+0 ms", "+120 ms"]


@pytest.mark.long
def test_what_it_is_not_computed_for(tmp_path: Path, weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cv2")
    script(monkeypatch, faces(12) * 2)
    video = write_flashes(tmp_path / "a.mp4", 0, 12)
    with pytest.raises(InputError, match="pictures and sound for 8 comparisons of lips and sound, required 16 or more"):
        compare(video, video, sync_weights=weights)
    motion = Motion(np.zeros((30, 1)), 25.0, (Channel("opening"),))
    with pytest.raises(InputError, match="weights of SyncNet, and no video to use them for"):
        compare(motion, motion, sync_weights=weights)
