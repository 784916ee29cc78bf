from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from lipmotion_blender.keying import add_sound, key_shapes


class Strips(list[Any]):
    """The strips of a sequencer."""

    def new_sound(self, name: str, path: str, channel: int, start: int) -> Any:
        self.append(SimpleNamespace(name=name, filepath=path, channel=channel, start=start, frame_final_start=start))
        return self[-1]


@pytest.mark.parametrize(
    ("sound_s", "start", "played_from"), [(0.0, 10, 10), (0.5, 22, 22), (-0.5, -2, 10)]
)  # fmt: skip
def test_the_sound_is_where_the_motion_is(sound_s, start, played_from, tmp_path):
    path = tmp_path / "a.wav"
    path.write_bytes(b"")
    strips = Strips()
    rate = SimpleNamespace(fps=24, fps_base=1.0)
    scene = SimpleNamespace(sequence_editor=SimpleNamespace(strips=strips), render=rate, sync_mode="")
    for _ in range(2):
        assert add_sound(scene, str(path), 10.0, sound_s)
    (strip,) = strips
    assert (strip.start, strip.frame_final_start) == (start, played_from)


@pytest.fixture
def keyed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Curve]]:
    """Returns the keyed curves of two shape keys after all calls so far."""
    keys: dict[str, Curve] = {}
    blocks = {name: SimpleNamespace(slider_min=0.0, slider_max=1.0) for name in ("jawOpen", "eyeBlinkLeft")}
    mesh = SimpleNamespace(name="face", data=SimpleNamespace(shape_keys=SimpleNamespace(key_blocks=blocks)))
    fcurves = SimpleNamespace(find=keys.get, new=lambda path: keys.setdefault(path, Curve()))
    monkeypatch.setattr("lipmotion_blender.keying._fcurves", lambda *_: fcurves)

    def key(values: list[float], first: float, **how: Any) -> list[Curve]:
        key_shapes(mesh, dict.fromkeys(blocks, values), {name: name for name in blocks}, first, **how)
        return list(keys.values())

    return key


def test_held_curves_are_held_between_keys(keyed):
    curves = keyed([0.0, 1.0], 1.0, stepped=("jawOpen",))
    kinds = [{point.interpolation for point in curve.keyframe_points} for curve in curves]
    assert kinds == [{"CONSTANT"}, {"LINEAR"}]


def test_keys_beside_those_of_a_take_are_kept_where_that_is_asked(keyed):
    keyed([0.5] * 5, 1.0)
    curve, _ = keyed([1.0, 1.0, 1.0], 2.0, replace=False)
    assert [point.co for point in curve.keyframe_points] == [(1, 0.5), (2, 1.0), (3, 1.0), (4, 1.0), (5, 0.5)]
    curve, _ = keyed([0.2], 7.0)
    assert [point.co for point in curve.keyframe_points] == [(7, 0.2)]


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
