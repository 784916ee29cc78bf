import gzip
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


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        ('<rect x="5" y="5" width="20" height="10"/>', 200),
        ('<rect x="5" y="5" width="20" height="20" rx="10"/>', np.pi * 100),
        ('<circle cx="20" cy="20" r="10"/>', np.pi * 100),
        ('<ellipse cx="20" cy="20" rx="15" ry="5"/>', np.pi * 75),
        ('<polygon points="5,5 25,5 25,25"/>', 200),
        ('<path d="M5 5h20v10H5z"/>', 200),
        ('<path d="M10 20a10 10 0 1 1 20 0a10 10 0 1 1-20 0z"/>', np.pi * 100),
        ('<path d="M10 20a10 10 0 1120 0a10 10 0 11-20 0z"/>', np.pi * 100),
        ('<path d="M10 10 C10 10 30 10 30 10 S30 30 30 30 Q20 30 10 30 z"/>', 400),
        ('<path d="M5 5H35V35H5zM15 15V25H25V15z"/>', 800),
        ('<path fill-rule="evenodd" d="M5 5H35V35H5zM15 15H25V25H15z"/>', 800),
        ('<path d="M5 5H35V35H5zM15 15H25V25H15z"/>', 900),
        ('<line x1="5" y1="20" x2="35" y2="20" stroke="red" stroke-width="4"/>', 120 + np.pi * 4),
        ('<g transform="translate(10,10) scale(2)"><rect width="5" height="5"/></g>', 100),
        ('<rect transform="rotate(90 20 20)" x="10" y="18" width="20" height="4"/>', 80),
        ('<rect width="10" height="10" fill="none"/>', 0),
        ('<rect width="10" height="10" opacity="0.5"/>', 50),
        ('<rect width="10" height="10" style="fill:#ff0000;fill-opacity:.25"/>', 25),
    ],
)
def test_shapes_cover_what_they_should(shape, area):
    assert picture(shape).sum() == pytest.approx(area, rel=0.06, abs=12)


def test_colours_and_order():
    drawing = parse_drawing(svg('<rect width="40" height="40" fill="#f00"/><rect width="20" height="40" fill="blue"/>'))
    layer = layered.paint_shapes([(shape, (0.0, 0.0)) for _, shape in drawing.shapes], WHOLE, 40, 40)
    assert layer[20, 10].tolist() == [0, 0, 255, 1]
    assert layer[20, 30].tolist() == [255, 0, 0, 1]


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ('<image href="http://host/a.png"/>', "not read|reference"),
        ('<rect fill="url(#a)" width="1" height="1"/>', "reference"),
        ('<g style="filter:url(file:///etc/passwd)"><rect width="1" height="1"/></g>', "reference"),
        ('<use xmlns:xlink="http://www.w3.org/1999/xlink" xlink:href="other.svg#a"/>', "not read|reference"),
        ("<script>alert(1)</script>", "<script> is not read"), ('<rect width="1" height="1" onclick="x()"/>', "script"),
        ("<style>@import url(a.css)</style>", "<style> is not read"), ("<text>a</text>", "<text> is not read"),
        ("<foreignObject/>", "not read"), ('<path d="M 0 0 L 1"/>', "ends within"),
        ('<path d="M 0 0 X 1"/>', "cannot be read"), ('<path d="1 2 3"/>', "without a command"),
        ('<rect width="wide" height="1"/>', "width is 'wide'"),
        ('<rect width="1" height="1" fill="nocolour"/>', "required a plain colour"),
        ('<polygon points="1 2 3"/>', "pairs"),
        ('<g transform="rotate(a)"><rect width="1" height="1"/></g>', "transform"), ("<g>" * 80 + "</g>" * 80, "deep"),
        ("", "no shape"), ('<path d="M0 0L1e9 1"/>', "numbers up to"),
        ('<rect width="1" height="1" transform="scale(1e200)"/>', "transform"),
        ('<g transform="scale(1e5)"><g transform="scale(1e5)"><rect width="1" height="1"/></g></g>', "enlarge"),
        ('<rect width="nan" height="1"/>', "width is 'nan'"), ('<rect width="1" height="1e999"/>', "inf in '1e999'"),
        ('<g stroke-width="' + " " * 200 + '1"/>', "required a number"),
        ('<path d="M0 0a1 1 0 2 1 1 1"/>', "cannot be read at"), ('<path d="M0 0"><animate/></path>', "in a shape"),
        ("&a;", "undefined entity"),
    ],
)  # fmt: skip
def test_what_is_unsafe_or_would_be_drawn_wrongly_is_refused(inside, words):
    with pytest.raises(InputError, match=words):
        parse_drawing(svg(inside))


@pytest.mark.parametrize(
    "data",
    [
        b"", b"not xml", b"<html/>", b"<svg", b"\xff\xfe\x00", b'<svg viewBox="0 0 0 0"><rect/></svg>',
        b'<svg viewBox="0 0 900000 4"><rect/></svg>',
        b'<!DOCTYPE svg [<!ENTITY a "b">]><svg>&a;</svg>', b'<!DOCTYPE svg [ <!ENTITY % x SYSTEM "file:///x"> ]><svg/>',
        b'<!DOCTYPE svg SYSTEM "file:///x"><svg>&a;</svg>', b'<?xml-stylesheet href="a.css"?><svg/>',
    ],
)  # fmt: skip
def test_what_is_no_drawing_is_refused(data):
    with pytest.raises(InputError):
        parse_drawing(data)


def test_a_drawing_is_utf_8_whatever_it_declares():
    entities = '<!DOCTYPE svg [<!ENTITY a "b">]><svg id="&a;"/>'
    plain = svg(f'<g id="é">{MOUTH_ONLY}</g>')
    doctype = b'<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">'
    for before in (b"", b"\xef\xbb\xbf", b'<?xml version="1.0" encoding="iso-8859-1"?>', doctype):
        assert parse_drawing(before + plain).shapes[0][0] == ("", "é", "mouth-rest")
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
    path.write_bytes(svg(ground + f'<g id="head">{MOUTH_ONLY}</g>', "0 0 80 40"))
    motion = Motion(np.zeros((3, 1)), 25.0, (Channel("opening"),))
    frame = next(iter(stage_face(str(path), Staging(size=64)).render(motion, said("sil"))))
    assert frame.shape == (64, 128, 3)
    assert frame[60, 100].tolist() == [0, 255, 0]
    clear = next(iter(stage_face(str(path), Staging(size=64, background="transparent")).render(motion, said("sil"))))
    assert clear.shape == (64, 128, 4)
    assert clear[60, 100, 3] == 0
    assert clear[..., 3].max() > 200
