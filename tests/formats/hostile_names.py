"""Names and texts that break formats which do not escape them, and what each writer makes of them."""

import ast
import html
import re
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from urllib.parse import quote

import numpy as np

from formats.examples import of_motion
from lipmotion import CueSheet, errors, formats, read_motion, types
from lipmotion.cli.verbs import about
from lipmotion.formats import annotations, label_files
from lipmotion.formats.cues import write_cue_file
from lipmotion.meshes.model.mesh import Blendshape, Material, Mesh, MeshPart
from lipmotion.printable import is_line, printable
from lipmotion.storage.files import as_text
from lipmotion_faces.characters import gltf_document, gltf_writer, usd_writer
from lipmotion_faces.characters.scene import Scene

PARTS = (
    *('"', '""', "'", "'''", "\\", "\\\\", '\\"', "\n", "\r\n", "\r", "\t", "\0", "\x1b[2J", "\x7f", "\x85", "\u2028"),
    *("]]>", "-->", "--", "<!--", "<script>alert(1)</script>", "</script>", "&amp;", "&#0;", "&", "<", ">", "<b>"),
    *("\ud800", "\udcff", "\udc00\ud800", "\u202e", "\u200f", "\u200d", "\ufeff", "\uffff", "\U0001f600", "é",
        "e\u0301"),
    *("@", "@@@", "@@@@", ";", ",", "=cmd()", "+1", "-1", "|", "#", "%s", "{0}", "${x}", "`x`", "$(x)", "//", "/*"),
    *("# x", "o x\nv 1 2 3", '"; import os; os.abort(); "', "'+__import__('os').abort()+'", "}\n@misc{x,", "]", "[",
        "}"),
    *(" ", "  ", "\u3000", "\xa0", "", "a b", "NOTE", "WEBVTT", "00:00 --> 00:01", "time_s", "x" * 300, "٣", "fap3_é"),
)  # fmt: skip


def names() -> Iterator[str]:
    """Yield every part alone, at both ends and in the middle of a word, and every two of them, each name once."""
    alone = [name for part in PARTS for name in (part, f"a{part}", f"{part}a", f"a{part}a")]
    for name in dict.fromkeys([*alone, *(f"a{one}{other}" for one, other in product(PARTS, PARTS))]):
        if not re.search("[\ud800-\udbff][\udc00-\udfff]", name):  # JSON reads two such halves as one character
            yield name


def generation(name: str, unit: str = "eye_distance", label: types.Unit | None = None) -> types.Generation:
    """Return three frames of a channel of that name."""
    motion = types.Motion(np.array([[0.0], [0.5], [0.25]]), 25.0, (types.Channel(name, unit),))
    return of_motion(motion, types.Timeline((types.Span(0.0, 0.1, label or types.Unit("aa")),)))


def mesh(name: str) -> Mesh:
    """Return a triangle with a blendshape, a part and a material of that name."""
    part = MeshPart(name, 0, 1, Material(name))
    shape = Blendshape(name, np.array([0]), np.array([[0.0, 0.1, 0.0]]))
    return Mesh(np.eye(3), np.array([[0, 1, 2]], np.int32), (part,), shapes=(shape,))


def _motion_file(suffix: str) -> Callable[[Path, str], None]:
    def check(folder: Path, name: str) -> None:
        path = folder / f"a.{suffix}"
        formats.write_motion(path, generation(name), source={"file": name, "path": name}, model={"name": name})
        assert read_motion(path)[0].names == (name,)

    return check


def _fap(folder: Path, name: str) -> None:
    path = folder / "a.fap"
    formats.write_motion(path, generation(f"fap3_{name}"), source={"file": name}, model={})
    assert read_motion(path)[0].names == ("fap3_open_jaw",)


def _script(folder: Path, name: str) -> None:
    path = folder / "a.blender.py"
    formats.write_motion(path, generation(name), source={"path": name}, model={})
    text = path.read_bytes().decode("ascii")
    body = ast.parse(text[text.index("\nRATE_HZ = ") : text.index("\n}\n") + 3]).body
    values = {ast.unparse(node.targets[0]): node.value for node in body if isinstance(node, ast.Assign)}
    assert len(body) == len(values) == 5
    assert ast.literal_eval(values["SOUND"]) == name
    assert list(ast.literal_eval(values["MOTION"])) == [name]


def _labels(suffix: str, read: Callable[[str], str]) -> Callable[[Path, str], None]:
    def check(folder: Path, name: str) -> None:
        path = folder / f"a{suffix}"
        label_files.write_labels(path, generation("a", label=types.Unit("aa", word=f"x{name}x")).units)
        assert read(path.read_bytes().decode()) == f"x{name}x"

    return check


def _of_textgrid(text: str) -> str:
    return annotations.parse_interval_tiers(text, "a")[1].labels[0].text


def _of_webvtt(text: str) -> str:
    head, times, word, end = text.split("\n")[:1], *text.split("\n")[2:5]
    assert head == ["WEBVTT"]
    assert re.fullmatch(r"[\d:.]+ --> [\d:.]+", times)
    assert end == ""
    assert "<" not in word
    assert "-->" not in word
    return html.unescape(word)


def _cues(form: str, read: Callable[[str], list[str]]) -> Callable[[Path, str], None]:
    def check(folder: Path, name: str) -> None:
        path, word = folder / f"a.{form}", f"x{name}x"
        cues = types.Timeline((types.Span(0.0, 0.1, "X"), types.Span(0.1, 0.5, "A")))
        sheet = CueSheet(cues, 10.0, "ABCDEFX", types.Timeline((types.Span(0.1, 0.5, word),)))
        write_cue_file(path, sheet, as_text(word), form)
        assert read(path.read_bytes().decode()) in ([as_text(word)], [_seen(as_text(word)), _seen(word)], [])

    return check


def _seen(text: str) -> str:
    """Return a text as formats of lines have it that cannot refuse a word: blanks made one or none."""
    plain = "".join(text.split()).replace("|", "/")
    return plain if is_line(plain) else printable(plain)


def _of_pgo(text: str) -> list[str]:
    lines = text.split("\n")
    assert [line.count("\t") for line in lines] == [0, 0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2, 3, 4, 0]
    word, first, last, shapes = lines[12].split()
    assert (int(first), int(last), int(shapes)) == (1, int(lines[3]) - 1, 1)
    assert lines[6].strip("\t") == lines[8].strip("\t") == word
    return ["".join(lines[1].split()), word]


def _usda(folder: Path, name: str) -> None:
    path = folder / "a.usda"
    usd_writer.write_usda(path, Scene(mesh(name), sound=as_text(f"x{name}")))
    text = path.read_bytes().decode()
    assert _usd_tokens(text, "uniform token[] blendShapes") == [as_text(name)]
    found = re.search(r"filePath = (@@@(?:[^@\n]|@{1,2}(?!@)|\\@@@)*?@{0,2}@@@(?!@)|@[^@\n]*@)\n", text)
    assert found, text[text.index("filePath") :][:80]
    mark = 3 if found[1].startswith("@@@") else 1
    assert found[1][mark:-mark].replace("\\@@@", "@@@").removeprefix("./") == as_text(f"x{name}")
    assert not re.search(r"[\x00-\x09\x0b-\x1f]", text)


def _usd_tokens(text: str, attribute: str) -> list[str]:
    line = next(line for line in text.split("\n") if line.strip().startswith(attribute))
    return list(ast.literal_eval(line.partition(" = ")[2]))


def _glb(folder: Path, name: str) -> None:
    path = folder / "a.glb"
    moved = types.Motion(np.zeros((2, 1)), 25.0, (types.Channel(name, types.WEIGHT),))
    gltf_writer.write_gltf_scene(path, Scene(mesh(name), moved, sound=f"x{name}"))
    document = gltf_document.read_gltf_document(path).json
    assert document["meshes"][0]["extras"]["targetNames"] == [name]
    assert document["scenes"][0]["extras"]["audio"]["uri"] == quote(as_text(f"x{name}"), safe="/")
    assert document["materials"][0]["name"] == (name or "part")


def _bibtex(_: Path, name: str) -> None:
    entries = about.list_model_citations({"engine": "own" + name, "attribution": [f"x{name}x"]})
    assert sum(line.startswith("@") for line in re.split(r"[\n\r]", entries)) == 1


WRITERS: dict[str, Callable[[Path, str], None]] = {
    **{suffix: _motion_file(suffix) for suffix in ("json", "csv", "npz", "c3d")}, "fap": _fap,
    "blender.py": _script, ".TextGrid": _labels(".TextGrid", _of_textgrid), ".vtt": _labels(".vtt", _of_webvtt),
    "pgo": _cues("pgo", _of_pgo),
    **{"usda": _usda, "glb": _glb, "bibtex": _bibtex},
}  # fmt: skip
"""By format: writes a name into a file of a folder, and reads it back; asserts that it is the same."""


def outcome(writer: str, folder: Path, name: str) -> str:
    """Return ``kept``, or ``refused`` where there is one line and no file instead. Raises what else there is."""
    try:
        WRITERS[writer](folder, name)
    except (errors.ExportError, errors.InputError) as error:
        good = len(printable(error)) < 1000 and not list(folder.iterdir())
        return "refused" if good else f"refused with a long line, or a file is left: {error}"
    for path in folder.iterdir():
        path.unlink()
    return "kept"
