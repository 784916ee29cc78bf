"""Animations of Godot: the text of a resource that Godot saved, and keys that are those of the motion."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from export.motion.curve_examples import generation
from lipmotion.errors import ExportError
from lipmotion.export import write_motion

TRACK = re.compile(
    r'tracks/(\d+)/type = "blend_shape"\ntracks/\1/imported = false\ntracks/\1/enabled = true\n'
    r'tracks/\1/path = NodePath\("\.:(\w+)"\)\ntracks/\1/interp = ([01])\ntracks/\1/loop_wrap = false\n'
    r"tracks/\1/keys = PackedFloat32Array\(([^)]*)\)\n"
)


def test_a_resource_has_the_tracks_of_the_motion(tmp_path: Path) -> None:
    talking = generation("jawOpen", "viseme_PP", "headYaw", stepped=("viseme_PP",))
    write_motion(tmp_path / "a.tres", talking, source={}, model={})
    text = (tmp_path / "a.tres").read_text(encoding="utf-8")
    head = '[gd_resource type="Animation" format=3]\n\n[resource]\nresource_name = "speech"\n'
    head += "length = 1\nstep = 0.0333333\n"
    assert text.startswith(head)
    found = TRACK.findall(text)
    assert [(number, name, interp) for number, name, interp, _ in found] == [
        ("0", "jawOpen", "1"),
        ("1", "viseme_PP", "0"),
    ]
    assert head + "".join(match[0] for match in TRACK.finditer(text)) == text
    keys = [np.array([float(number) for number in each[3].split(",")]).reshape(-1, 3) for each in found]
    assert {*keys[0][:, 1]} == {1.0}
    again = np.interp(talking.motion.time_s, keys[0][:, 0], keys[0][:, 2])
    assert again == pytest.approx(talking.motion["jawOpen"], abs=2e-4)
    assert keys[1][:, 2].tolist() == [0.25, 0.75, 0.5, 0.5]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_godot_parser_reads_the_same_tracks(tmp_path: Path) -> None:
    godot_parser = pytest.importorskip("godot_parser")
    talking = generation("jawOpen", "viseme_PP", "headYaw", stepped=("viseme_PP",))
    write_motion(tmp_path / "a.tres", talking, source={}, model={})
    read = godot_parser.load(str(tmp_path / "a.tres"))
    (resource,) = read.get_sections("resource")
    assert (read.find_section("gd_resource").header.attributes["type"], resource["resource_name"]) == (
        "Animation",
        "speech",
    )
    assert [str(resource[f"tracks/{n}/path"].path) for n in range(2)] == [".:jawOpen", ".:viseme_PP"]
    keys = np.array(resource["tracks/0/keys"].args, float).reshape(-1, 3)
    again = np.interp(talking.motion.time_s, keys[:, 0], keys[:, 2])
    assert again == pytest.approx(talking.motion["jawOpen"], abs=2e-4)


def test_names_that_no_path_has_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"'Face\.jawOpen' has one of the letters"):
        write_motion(tmp_path / "a.tres", generation("Face.jawOpen"), source={}, model={})
    with pytest.raises(ExportError, match="no blendshapes"):
        write_motion(tmp_path / "a.tres", generation("headYaw"), source={}, model={})
