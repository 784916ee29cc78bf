"""What the add-on does with a scene, with a stand-in for Blender's."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from lipmotion.addons.blender.keying import add_sound, key_shapes


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


def test_held_curves_are_held_between_keys() -> None:
    keys: dict[str, Curve] = {}
    blocks = {name: SimpleNamespace(slider_min=0.0, slider_max=1.0) for name in ("jawOpen", "eyeBlinkLeft")}
    data = SimpleNamespace(shape_keys=SimpleNamespace(key_blocks=blocks))

    def new(path: str) -> Curve:
        return keys.setdefault(path, Curve())

    fcurves = SimpleNamespace(find=lambda _: None, new=new)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lipmotion.addons.blender.keying._fcurves", lambda *_: fcurves)
        mesh = SimpleNamespace(name="face", data=data)
        curves = {name: [0.0, 1.0] for name in blocks}
        key_shapes(mesh, curves, {name: name for name in blocks}, 1.0, stepped=("jawOpen",))
    kinds = [{point.interpolation for point in curve.keyframe_points} for curve in keys.values()]
    assert kinds == [{"CONSTANT"}, {"LINEAR"}]


class Points(list[Any]):
    """The keys of a curve."""

    def add(self, count: int) -> None:
        self += [SimpleNamespace(co=(0.0, 0.0), interpolation="BEZIER") for _ in range(count)]

    def foreach_set(self, _: str, numbers: list[float]) -> None:
        for point, place in zip(self, zip(numbers[::2], numbers[1::2], strict=True), strict=True):
            point.co = place


class Curve:
    """A curve of an action."""

    def __init__(self) -> None:
        self.keyframe_points = Points()

    def update(self) -> None:
        pass
