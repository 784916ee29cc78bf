"""The sound that a glTF file names."""

from __future__ import annotations

import json

import pytest

from lipmotion.meshes.files.gltf_writer import find_named_sound, sound_extras


@pytest.mark.parametrize(
    ("extras", "found"),
    [(sound_extras("../a b/#1 50%.wav", 0.5), "../a b/#1 50%.wav"),
     ({"audio": {"uri": "ä.wav"}}, "ä.wav"),
     (sound_extras("a.wav", 2**63), None),
     ({"audio": {"uri": "https://example.org/a.wav"}}, None),
     ({"audio": {"uri": "file:a.wav"}}, None),
     ({"audio": {"uri": "/a.wav"}}, None),
     ({"audio": {"uri": "a%00.wav"}}, None),
     ({"audio": {"uri": 7}}, None),
     ({"audio": "a.wav"}, None),
     (["audio"], None)],
)  # fmt: skip
def test_paths_from_the_folder_of_the_file_count(tmp_path, extras, found):
    text = json.dumps({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"extras": extras}]})
    (tmp_path / "a.gltf").write_text(text, encoding="utf-8")
    named = find_named_sound(tmp_path / "a.gltf")
    assert (named and named[0]) == (found and tmp_path / found)
