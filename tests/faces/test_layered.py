import gzip
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion_faces import Staging, make_face, stage_face, testing
from lipmotion_faces.portrait import geometry, layered
from lipmotion_faces.portrait.svg_document import parse_drawing

ROBOT = Path(__file__).parents[2] / "examples" / "robot.svg"
WHOLE = np.array([[1.0, 0, 0], [0, 1, 0]])
MOUTH_ONLY = '<g id="mouth-rest"><rect width="10" height="5"/></g>'


def svg(inside: str, box: str = "0 0 40 40") -> bytes:
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}">{inside}</svg>'.encode()


def picture(inside: str, size: int = 40) -> np.ndarray:
    """Return the cover of shapes [shape=(size, size)]."""
    shapes = [(shape, (0.0, 0.0)) for _, shape in parse_drawing(svg(inside)).shapes]
    return layered.paint_shapes(shapes, WHOLE, size, size)[..., 3]


@pytest.mark.long
def test_the_example_keeps_the_contract():
    testing.check_face(make_face(str(ROBOT)))


DRAWINGS = json.loads(Path(__file__).with_name("drawings.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("shape", "area"), DRAWINGS["areas"])
def test_shapes_cover_what_they_should(shape, area):
    assert picture(shape).sum() == pytest.approx(area, rel=0.06, abs=12)


def test_colours_and_order():
    drawing = parse_drawing(svg('<rect width="40" height="40" fill="#f00"/><rect width="20" height="40" fill="blue"/>'))
    layer = layered.paint_shapes([(shape, (0.0, 0.0)) for _, shape in drawing.shapes], WHOLE, 40, 40)
    assert layer[20, [10, 30]].tolist() == [[0, 0, 255, 1], [255, 0, 0, 1]]


@pytest.mark.parametrize(("inside", "words"), DRAWINGS["refused"])
def test_what_is_unsafe_or_would_be_drawn_wrongly_is_refused(inside, words):
    with pytest.raises(InputError, match=words):
        parse_drawing(svg(inside))


@pytest.mark.parametrize(("names", "layer"), DRAWINGS["layers"])
def test_layers_have_the_names_that_programs_write(names, layer):
    for inside in (f'<g {names}><rect width="9" height="9"/></g>', f'<rect {names} width="9" height="9"/>'):
        assert parse_drawing(svg(inside)).shapes[0][0] == (layer,)


@pytest.mark.parametrize("text", DRAWINGS["no drawings"])
def test_what_is_no_drawing_is_refused(text):
    with pytest.raises(InputError):
        parse_drawing(text.encode("latin-1"))


def test_a_drawing_is_utf_8_whatever_it_declares():
    entities = '<!DOCTYPE svg [<!ENTITY a "b">]><svg id="&a;"/>'
    plain = svg(f'<g id="é">{MOUTH_ONLY}</g>')
    doctype = b'<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">'
    for before in (b"", b"\xef\xbb\xbf", b'<?xml version="1.0" encoding="iso-8859-1"?>', doctype):
        assert parse_drawing(before + plain).shapes[0][0] == ("é", "mouth-rest")
    for coding in ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp037"):
        for text in (entities, plain.decode()):
            declared = f'<?xml version="1.0" encoding="{coding}"?>{text}'
            with pytest.raises(InputError, match=r"not text in UTF-8|not an SVG|entities"):
                parse_drawing(declared.encode(coding))
    with pytest.raises(InputError, match="compressed"):
        parse_drawing(gzip.compress(plain))


def test_a_drawing_has_limits_as_a_whole():
    square = '<rect width="40" height="40"/>'
    for inside, words in {
        square * 201: "cover more than 200 times",
        '<path stroke="red" stroke-width="40" d="M0 0' + "h1" * 300 + '"/>': "cover more than 200 times",
        square * 150 + f'<path d="M0 0{"L1 40L2 0" * 2_600}"/>': "cover more than 200 times",
        "<metadata>" + "<a/>" * 20_000 + "</metadata>": "more than 20000 elements",
        "<metadata>" * 100_000: "more than 60 deep",
        f'<g transform="{"a" * 2_000_000}"/>': "transform 'a+...' cannot be read",
        f'<g transform="{"scale(1)" * 21}"/>': "at most 20",
        f'<path d="{"M" * 2_000_000}"/>': "ends within",
    }.items():
        with pytest.raises(InputError, match=words):
            parse_drawing(svg(inside))
    with pytest.raises(InputError, match="not an SVG"):
        parse_drawing(b"<!DOCTYPE svg " * 300_000)


@settings(max_examples=150)
@given(st.lists(st.sampled_from("MmLlHhVvCcSsQqTtAaZz0123456789.,- e"), max_size=40).map("".join))
def test_any_path_is_read_or_refused(path):
    try:
        drawing = parse_drawing(svg(f'<path d="{path}"/>'))
    except InputError:
        return
    for _, shape in drawing.shapes:
        assert all(np.isfinite(points).all() for points, _ in shape.lines)


def test_a_drawing_needs_a_resting_mouth_and_known_ones(tmp_path):
    path, square = tmp_path / "a.svg", '<rect width="1" height="1"/></g>'
    for content, message in (
        (f'<g id="mouth-aa">{square}', "no layer mouth-rest"),
        (f'{MOUTH_ONLY}<g id="mouth-q">{square}', r"mouth-q.*mouth-oo"),
    ):
        path.write_bytes(svg(content))
        with pytest.raises(InputError, match=message):
            make_face(str(path))
    path.write_bytes(svg(MOUTH_ONLY + f'<g id="head"><g id="eye-closed">{square}</g>'))
    with pytest.warns(UserWarning, match="eye-closed.*is it eyes-closed"), pytest.warns(match="the only mouth"):
        make_face(str(path))
    with pytest.raises(InputError, match="cannot be read"):
        make_face(str(tmp_path / "none.svg"))


def said(*phones: str) -> Timeline[Unit]:
    return Timeline(tuple(Span(0.4 * n, 0.4 * n + 0.4, Unit(phone)) for n, phone in enumerate(phones)))


def test_sounds_choose_their_mouths():
    key = layered.MOUTHS["rest"]
    poses = [geometry.MouthPose(key.gap, teeth=0)] * 5
    for name in ("fv", "aa", "oo", "th", "ee", "mbp"):
        k = layered.MOUTHS[name]
        poses += [geometry.MouthPose(k.gap, k.width, **{name: getattr(k, name) for name in k._fields[2:]})] * 5
    shown = layered.choose_mouths(poses, list(layered.MOUTHS), 25.0)
    assert shown[2::5] == ["rest", "fv", "aa", "oo", "th", "ee", "mbp"]


def test_a_mouth_that_is_missing_is_replaced_and_closures_are_never_skipped():
    poses = [geometry.MouthPose(0.2)] * 10 + [geometry.MouthPose(0.0, press=1.0)] + [geometry.MouthPose(0.2)] * 10
    assert layered.choose_mouths(poses, ["rest", "eh"], 60.0) == ["eh"] * 10 + ["rest"] + ["eh"] * 10


def test_mouths_do_not_flicker():
    rng = np.random.default_rng(0)
    poses = [geometry.MouthPose(float(gap)) for gap in 0.12 + 0.02 * rng.standard_normal(100)]
    shown = layered.choose_mouths(poses, list(layered.MOUTHS), 25.0)
    alone = [layered.choose_mouths([pose], list(layered.MOUTHS), 25.0)[0] for pose in poses]

    def changes(names):
        return sum(one != other for one, other in pairwise(names))

    assert changes(shown) < 0.4 * changes(alone)


def test_the_picture_has_the_shape_of_the_drawing_and_may_be_transparent(tmp_path):
    path = tmp_path / "wide.svg"
    ground = '<g id="background"><rect width="80" height="40" fill="#00ff00"/></g>'
    beside = '<g id="mouth-aa"><rect x="60" y="30" width="20" height="10"/></g>'  # moves with the head as well
    path.write_bytes(svg(ground + f'<g id="head">{MOUTH_ONLY}</g>{beside}', "0 0 80 40"))
    motion = Motion(np.zeros((3, 1)), 25.0, (Channel("opening"),))
    frame = next(iter(stage_face(str(path), Staging(size=64)).render(motion, said("sil"))))
    assert frame.shape == (64, 128, 3)
    assert frame[60, 100].tolist() == [0, 255, 0]
    clear = next(iter(stage_face(str(path), Staging(size=64, background="transparent")).render(motion, said("sil"))))
    assert (clear.shape, clear[60, 100, 3]) == ((64, 128, 4), 0)
    assert clear[..., 3].max() > 200
