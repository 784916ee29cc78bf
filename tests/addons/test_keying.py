"""What the add-on does with a scene, with a stand-in for Blender's."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from lipmotion.addons.blender.keying import add_sound


class Strips(list[Any]):
    """The strips of a sequencer."""

    def new_sound(self, name: str, path: str, channel: int, start: int) -> Any:
        self.append(SimpleNamespace(name=name, filepath=path, channel=channel, start=start, frame_final_start=start))
        return self[-1]


@pytest.mark.parametrize(
    ("sound_s", "start", "heard_from"), [(0.0, 10, 10), (0.5, 22, 22), (-0.5, -2, 10)]
)  # fmt: skip
def test_the_sound_is_where_the_motion_is(sound_s: float, start: int, heard_from: int, tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(b"")
    strips = Strips()
    rate = SimpleNamespace(fps=24, fps_base=1.0)
    scene = SimpleNamespace(sequence_editor=SimpleNamespace(strips=strips), render=rate, sync_mode="")
    for _ in range(2):
        assert add_sound(scene, str(path), 10.0, sound_s)
    (strip,) = strips
    assert (strip.start, strip.frame_final_start) == (start, heard_from)
