"""What the files of a character may hold and cost is refused before it is made."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from fuzz.character_floods import CHARACTER_FLOODS
from fuzz.inputs import lay_out
from lipmotion.errors import InputError
from lipmotion.meshes.files.character_files import read_character
from lipmotion.meshes.files.gltf_writer import write_animated_gltf
from lipmotion.meshes.model.file_limits import ALLOWANCE, Budget
from lipmotion.types import WEIGHT, Channel, Motion
from meshes.gltf import document, glb

REFUSED = {
    "matrices without bytes": "12000000 joints",
    "3,000 nodes with one mesh": "2001 parts",
    "factors that are multiplied": r"node 2 is beyond ±1e\+09",
    "lists of lists": "values in a document",
    "too many vertices without bytes": "1000000000 vertices",
    "too many compressed zeros": "compressed bytes",
    "compressed zeros": "compressed data is damaged",
}
READ = ("cycles outside of the scene", "9,000 binds")


def laid_out(name: str, folder: Path) -> Path:
    folder.mkdir()
    lay_out(CHARACTER_FLOODS[name](), folder)
    return next(folder.glob("head.[go]*"))


def test_expensive_characters_are_refused_with_what_is_too_much(tmp_path: Path) -> None:
    for number, (name, message) in enumerate(REFUSED.items()):
        with pytest.raises(InputError, match=message):
            read_character(laid_out(name, tmp_path / str(number)))


def test_what_is_not_in_the_scene_costs_nothing(tmp_path: Path) -> None:
    for number, name in enumerate(READ):
        assert len(read_character(laid_out(name, tmp_path / str(number))).triangles) == 2


def test_a_budget_is_that_of_all_files_together(tmp_path: Path) -> None:
    budget = Budget()
    budget.spend("vertices", ALLOWANCE["vertices"])
    with pytest.raises(
        InputError, match=f"{ALLOWANCE['vertices'] + 1} vertices, required at most {ALLOWANCE['vertices']}"
    ):
        budget.spend("vertices", 1)
    budget.spend("bytes of files", ALLOWANCE["bytes of files"] - 3)
    (tmp_path / "head.bin").write_bytes(b"four")
    with pytest.raises(InputError, match="bytes of files"):
        budget.file_bytes(tmp_path / "head.bin", "buffer")


@pytest.mark.skipif(sys.platform == "win32", reason="pipes as POSIX has them")
def test_buffers_lead_to_no_pipe_folder_or_other_folder(tmp_path: Path) -> None:
    content, _ = document()
    os.mkfifo(tmp_path / "pipe.bin")
    (tmp_path / "loop.bin").symlink_to("loop.bin")
    for uri in ("pipe.bin", "loop.bin", "..", ".", "", "%2e%2e/x", "a/b.bin", "x" * 5000, "\ud800", "data:,x", "a\0b"):
        content["buffers"][0]["uri"] = uri
        (tmp_path / "head.gltf").write_text(json.dumps(content))
        with pytest.raises(InputError):
            read_character(tmp_path / "head.gltf")


def test_lines_of_obj_are_counted_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "head.obj"
    wrong = {
        "lines, required at most": b"\n" * (ALLOWANCE["lines"] + 1),
        "is no vertex of 3 numbers in line 2": b"#\nv\nv\n",
        "a line of 80001 bytes": b"f" + b" 1" * 40_000,
        "a polygon of 1001 corners": b"v 0 0 0\nf" + b" 1" * 1001,
        "2001 parts": b"v 0 0 0\n" + b"".join(b"g %d\nf 1 1 1\n" % n for n in range(2001)),
    }
    for message, content in wrong.items():
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_character(path)


def test_a_file_without_scenes_is_animated(tmp_path: Path) -> None:
    content, binary = document()
    del content["scene"], content["scenes"]
    (tmp_path / "head.glb").write_bytes(glb(content, binary))
    moved = Motion(np.zeros((3, 1)), 30.0, (Channel("jawOpen", WEIGHT),))
    assert write_animated_gltf(tmp_path / "a.glb", tmp_path / "head.glb", moved, "a.wav")
    assert len(read_character(tmp_path / "a.glb").shapes) == 2
