from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from formats.examples import generation as weights_of
from formats.examples import written
from lipmotion import read_motion as read_library_motion
from lipmotion.types import Generation
from lipmotion_blender.curves import at_frames, closures, matched, read_motion, spelling
from lipmotion_blender.keying import add_sound, key_shapes

NAMES = ("jawOpen", "mouthSmileLeft", "tongueOut")


@pytest.fixture
def generation() -> Generation:
    return weights_of(*NAMES, rate_hz=60.0, frames=121)


@pytest.mark.parametrize("suffix", [".json", ".csv", ".livelink.csv"])
def test_files_of_lipmotion_are_read(tmp_path, generation, suffix):
    curves, times = read_motion(str(written(tmp_path / f"a{suffix}", generation)))
    spelt = {spelling(name): values for name, values in curves.items()}
    assert times == pytest.approx(generation.motion.time_s.tolist(), abs=1e-4)
    for name in NAMES:
        assert spelt[spelling(name)] == pytest.approx(generation.motion[name].tolist(), abs=1e-5)


def test_a_take_at_30_frames_keeps_its_time_and_rows_of_the_time_before_are_left_out(tmp_path):
    codes = [f"01:59:59:{frame:02d}.500" for frame in (50, 52, 54, 56, 58)] + ["02:00:00:00.500"]
    rows = "".join(f"{code},61,0.5\n" for code in codes) + "02:00:00:02.500,0\n"
    (tmp_path / "take.csv").write_text("Timecode,BlendShapeCount,JawOpen\n" + rows)
    curves, times = read_motion(str(tmp_path / "take.csv"))
    assert times == pytest.approx([number / 30 for number in range(7)])
    assert curves["JawOpen"] == [0.5] * 6 + [0.0]
    rows = "".join(f"10:00:00:{frame:02d}.000,61,{n / 10}\n" for n, frame in enumerate((10, 12, 12, 11, 14)))
    (tmp_path / "take.csv").write_text("Timecode,BlendShapeCount,JawOpen\n" + rows)
    assert read_motion(str(tmp_path / "take.csv"))[0] == {"JawOpen": [0.0, 0.1, 0.4]}


@pytest.mark.parametrize(
    "codes",
    [
        [f"10:00:{n // 30:02d}:{n % 30:02d}.000" for n in range(90)],
        [f"10:00:{n // 24:02d}:{n % 24:02d}" for n in range(60)],
        [f"23:59:59:{n:02d}.500" for n in range(60)] + [f"00:00:00:{n:02d}.500" for n in range(30)],
        [f"00:00:59;{n:02d}" for n in range(30)] + [f"00:01:{n // 30:02d};{n % 30:02d}" for n in range(2, 52)],
        [f"10:00:0{n // 50}.{n % 50 * 20:03d}" for n in range(80)],
        [f"10:00:00:{n:02d}.000" for n in range(10, 21)],
    ],
    ids=["30 a second", "24 a second", "midnight", "drop-frame", "parts of a second", "less than a second"],
)
@pytest.mark.parametrize("head", ["Timecode,BlendShapeCount,JawOpen,TongueOut", "Timecode,JawOpen,TongueOut"])
def test_a_take_is_read_as_the_library_reads_it(tmp_path, codes, head):
    """Also with a row without a face, empty or of the count 0, which is bridged by a straight line."""
    count = "61," if "Count" in head else ""
    lines = [f"{code},{count}{number / 100},{number % 2}" for number, code in enumerate(codes)]
    lines[5] = f"{codes[5]},0" if count else f"{codes[5]},,"
    path = tmp_path / "take.csv"
    path.write_text("\n".join([head, *lines]) + "\n")
    curves, times = read_motion(str(path))
    library = read_library_motion(path)[0]
    assert times[-1] == pytest.approx(float(library.time_s[-1]), abs=0.5 / library.rate_hz)
    for name, other in (("JawOpen", "jawOpen"), ("TongueOut", "tongueOut")):
        assert np.interp(library.time_s, times, curves[name]) == pytest.approx(library[other], abs=1e-3)


def test_a_take_that_is_damaged_and_other_files_are_refused(tmp_path):
    for line, message in (
        ("soon,61,0.5", "'soon' is no timecode"),
        ("10:00:00:02.000,61", "no rows with values"),
        ("09:59:50:00.000,61,0.5", r"row 3 goes back by 10.00 s"),
        ("10:00:00:02.000,61,0.5,0.5", "row 3 has 2 curves, required 1"),
    ):
        first = "10:00:00:00.000,61,0.5" if "no rows" not in message else "10:00:00:00.000,0,0"
        (tmp_path / "take.csv").write_text(f"Timecode,BlendShapeCount,JawOpen\n{first}\n{line}\n")
        with pytest.raises(ValueError, match=message):
            read_motion(str(tmp_path / "take.csv"))
    for text in ("", "frame,a\n1,2\n", "{}", '{"format": "other"}'):
        for name in ("a.csv", "a.json"):
            (tmp_path / name).write_text(text)
            with pytest.raises(ValueError, match=r"first column|'format' must be|Expecting value"):
                read_motion(str(tmp_path / name))


def test_curves_find_their_shape_keys_by_any_spelling_of_one_name():
    keys = ["Basis", "head.jawOpen", "mouthSmile_R", "mouthSmileLeft", "mouthSmile_L"]
    found = matched(["jawOpen", "mouthSmileLeft", "mouthSmileRight", "tongueOut"], keys)
    assert found == {"jawOpen": "head.jawOpen", "mouthSmileLeft": "mouthSmileLeft", "mouthSmileRight": "mouthSmile_R"}
    names = ("mouthSmile_L", "mouthSmileLeft", "MouthSmileLeft", "head.mouthSmile_L", "Mouth Smile l")
    assert {spelling(name) for name in names} == {"mouthsmileleft"}


def test_frames_lie_on_straight_lines_and_lips_that_close_between_two_are_closed_at_the_nearer():
    times = [number / 100 for number in range(101)]
    curves = {"tongueOut": [float(number**2) for number in range(101)]}
    frames = at_frames(curves, times, 24.0)["tongueOut"]
    assert len(frames) == 25
    assert frames == pytest.approx(np.interp(np.arange(25) / 24, times, curves["tongueOut"]).tolist())
    jaw, close = [0.3] * 101, [0.0 if number != 52 else 0.3 for number in range(101)]
    curves = {"jawOpen": jaw, "mouthClose": close, "eyeBlinkLeft": times}
    assert closures(curves, 101) == [52]
    sampled = at_frames(curves, times, 25.0)
    assert sampled["mouthClose"][13] == pytest.approx(0.3)
    assert sum(sampled["mouthClose"]) == pytest.approx(0.3)
    assert sampled["eyeBlinkLeft"] == pytest.approx([number / 25 for number in range(26)])
    late = at_frames({"jawOpen": jaw, "mouthClose": [0.3 if n == 51 else 0.0 for n in range(101)]}, times, 25.0)
    assert late["mouthClose"][13] == pytest.approx(0.3)


def test_held_curves_are_not_interpolated_and_last_as_long_at_other_frames():
    found = at_frames({"browInnerUp": [0.0, 1.0, 0.0], "a": [0.0, 1.0, 0.0]}, [0.0, 0.1, 0.2], 20.0, ("a",))
    assert found["browInnerUp"] == pytest.approx([0, 0.5, 1, 0.5, 0])
    assert found["a"] == pytest.approx([0, 0, 1, 1, 0])
    jaw = np.repeat([0.3, 0.0, 0.4], [10, 10, 10]).tolist()
    poses = at_frames({"jawOpen": jaw}, (np.arange(30) / 100).tolist(), 24.0, ("jawOpen",))
    assert poses["jawOpen"] == pytest.approx([0.3, 0.3, 0.3, 0.0, 0.0, 0.4, 0.4])


class Strips(list[Any]):
    """The strips of a sequencer."""

    def new_sound(self, name: str, path: str, channel: int, start: int) -> Any:
        self.append(SimpleNamespace(name=name, filepath=path, channel=channel, start=start, frame_final_start=start))
        return self[-1]


@pytest.mark.parametrize(("sound_s", "start", "played_from"), [(0.0, 10, 10), (0.5, 22, 22), (-0.5, -2, 10)])
def test_the_sound_is_where_the_motion_is(sound_s, start, played_from, tmp_path):
    (tmp_path / "a.wav").touch()
    strips = Strips()
    rate = SimpleNamespace(fps=24, fps_base=1.0)
    scene = SimpleNamespace(sequence_editor=SimpleNamespace(strips=strips), render=rate, sync_mode="")
    for _ in range(2):
        assert add_sound(scene, str(tmp_path / "a.wav"), 10.0, sound_s)
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
