"""A reader with planted defects, to test that the fuzzer finds them."""

import os
import time
from pathlib import Path

import numpy as np

from fuzz.inputs import Files, Good, ImplausibleError, Reader
from lipmotion.errors import InputError

MEGABYTES = 80


def seeds(_: Good) -> list[Files]:
    return [{"a.txt": b"baby now"}]


def read(folder: Path, _: Good) -> None:
    order = (folder / "a.txt").read_bytes()
    if b"raise" in order:
        raise RuntimeError("planted")
    if b"refuse" in order:
        raise InputError("planted; give something else")
    if b"abort" in order:
        os.abort()
    if b"sleep" in order:
        time.sleep(60)
    if b"eat" in order:
        np.ones(MEGABYTES << 17)
    if b"drop" in order:
        Path("left").touch()
    if b"spoil" in order:
        (folder / "a.txt").write_bytes(b"")
    if b"lie" in order:
        raise ImplausibleError("planted")


def readers() -> dict[str, Reader]:
    return {"planted": Reader("planted", seeds, read)}
