"""Inputs that once showed defects, too large to be stored: long repetitions, small and expensive characters."""

import io
import json
import struct
import zlib
from collections.abc import Callable
from typing import Any

from PIL import Image

from fuzz.inputs import Files
from meshes.gltf import document, glb, textured_document
from robustness.motion_cases import GOOD

Change = Callable[[dict[str, Any]], None]


def _gltf(change: Change, extra: bytes = b"") -> Files:
    """Return the square, changed."""
    content, binary = document()
    change(content)
    return {"head.glb": glb(content, binary + extra)}


def _matrices(content: dict[str, Any]) -> None:
    content["accessors"] += [
        {"componentType": 5126, "count": 12_000_000, "type": "MAT4"},
        {"componentType": 5121, "count": 4, "type": "VEC4"},
        {"componentType": 5126, "count": 4, "type": "VEC4"},
    ]
    content["skins"] = [{"joints": [0], "inverseBindMatrices": 4}]
    content["nodes"][0]["skin"] = 0
    content["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": 5, "WEIGHTS_0": 6}


def _nodes(count: int, *, extra: Any = ()) -> Change:
    def change(content: dict[str, Any]) -> None:
        content["nodes"] = [{"mesh": 0} for _ in range(count)] + list(extra)
        content["scenes"] = [{"nodes": list(range(count))}]

    return change


def _cycles(content: dict[str, Any]) -> None:
    content["nodes"] += [{"name": "Head", "children": [1 + (n + 1) % 9000]} for n in range(9000)]
    content["nodes"][0]["children"] = []


def _chain(content: dict[str, Any]) -> None:
    content["nodes"] += [{"children": [n + 2], "scale": [1e9, 1e9, 1e9]} for n in range(200)] + [{}]
    content["scenes"] = [{"nodes": [0, 1]}]


def _primitives(count: int) -> Change:
    def change(content: dict[str, Any]) -> None:
        content["meshes"][0]["primitives"] *= count

    return change


def _targets(primitives: int, targets: int) -> Change:
    def change(content: dict[str, Any]) -> None:
        content["accessors"] += [dict(content["accessors"][0]) for _ in range(primitives)]
        first = content["meshes"][0]["primitives"][0] | {"targets": [{"POSITION": 1}] * targets}
        content["meshes"][0]["primitives"] = [first | {"attributes": {"POSITION": 4 + n}} for n in range(primitives)]
        del content["meshes"][0]["extras"]

    return change


def _zeros(count: int, kind: str = "VEC3", targets: int = 0) -> Change:
    """Vertices, and blendshapes, for which the file has no bytes."""

    def change(content: dict[str, Any]) -> None:
        content["accessors"][0] = {"componentType": 5126, "count": count, "type": kind}
        content["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}] * targets
        del content["meshes"][0]["extras"]

    return change


def _expressions(binds: int) -> Change:
    def change(content: dict[str, Any]) -> None:
        bind = {"node": 0, "index": 0, "weight": 1}
        custom = {f"e{n}": {"morphTargetBinds": [bind] * 10} for n in range(binds // 10)}
        content["extensions"] = {"VRMC_vrm": {"expressions": {"custom": custom}}}

    return change


def _png(width: int, height: int, colour: int = 6, bits: int = 8) -> bytes:
    """Return a picture of one colour, of any size, in little."""
    rows, body = zlib.compressobj(9), b""
    row = b"\0" * (1 + width * bits // 8 * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour])
    for _ in range(height):
        body += rows.compress(row)
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)),
        *([(b"PLTE", b"\0\0\0"), (b"tRNS", b"\0")] if colour == 3 else []),
        *((b"IDAT", body + rows.flush()), (b"IEND", b"")),
    ]
    written = (struct.pack(">I", len(b)) + n + b + struct.pack(">I", zlib.crc32(n + b)) for n, b in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(written)


def _jpeg(width: int, height: int, **options: Any) -> bytes:
    """Return a small picture that says it is of another size."""
    file = io.BytesIO()
    Image.new("RGB", (64, 64), (9, 99, 9)).save(file, "JPEG", **options)
    content = file.getvalue()
    at = content.index(b"\xff\xc2" if options.get("progressive") else b"\xff\xc0") + 5
    return content[:at] + struct.pack(">HH", height, width) + content[at + 4 :]


def _scans(count: int) -> bytes:
    content = _jpeg(8000, 8000, progressive=True)
    at = content.rindex(b"\xff\xda")
    return content[:at] + content[at:-2] * count + content[-2:]


def _pictured(picture: bytes, count: int = 1, *, copies: bool = False) -> Files:
    """Return the square, many times, each with a material, a texture and an image of its own, of one picture."""
    content, binary = textured_document(picture)
    for name in ("images", "textures", "materials"):
        content[name] = [json.loads(json.dumps(content[name][0])) for _ in range(count)]
    for number in range(count):
        content["textures"][number]["source"] = number
        content["materials"][number]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = number
    if copies:
        content["bufferViews"] += [dict(content["bufferViews"][-1]) for _ in range(count - 1)]
        for number in range(count):
            content["images"][number]["bufferView"] = len(content["bufferViews"]) - 1 - number
    first = content["meshes"][0]["primitives"][0]
    content["meshes"][0]["primitives"] = [first | {"material": number} for number in range(count)]
    return {"head.glb": glb(content, binary)}


def _chunks(count: int) -> Files:
    (whole,) = _gltf(lambda _: None).values()
    body = whole[12:] + struct.pack("<II", 0, 0) * count
    return {"head.glb": struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body}


def _json(text: bytes) -> Files:
    return {"head.gltf": b'{"asset":{"version":"2.0"},"extras":' + text + b"}"}


def _obj(text: bytes, **others: bytes) -> Files:
    return {"head.obj": text} | {name.replace("_", "."): content for name, content in others.items()}


SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
LIBRARY = b"".join(b"newmtl m%d\nmap_Kd skin.png\n" % n for n in range(2000))
USED = SQUARE + b"".join(b"usemtl m%d\nf 1 2 3\n" % n for n in range(2000))
CHARACTER_FLOODS: dict[str, Callable[[], Files]] = {
    "matrices without bytes": lambda: _gltf(_matrices),
    "2,000 primitives": lambda: _gltf(_primitives(2000)),
    "3,000 nodes with one mesh": lambda: _gltf(_nodes(3000)),
    "a million nodes": lambda: _gltf(_nodes(333_000)),
    "cycles outside of the scene": lambda: _gltf(_cycles),
    "factors that are multiplied": lambda: _gltf(_chain),
    "many targets of many parts": lambda: _gltf(_targets(1000, 900)),
    "targets": lambda: _gltf(_targets(1, 100_000)),
    "vertices without bytes": lambda: _gltf(_zeros(200_000)),
    "too many vertices without bytes": lambda: _gltf(_zeros(10**9)),
    "100,000 binds": lambda: _gltf(_expressions(100_000)),
    "9,000 binds": lambda: _gltf(_expressions(9_000)),
    "a picture of 8192 by 8192": lambda: _pictured(_png(8192, 8192, 2)),
    "20 textures of one picture": lambda: _pictured(_png(8192, 8192, 2), 20),
    "20 pictures of 8192 by 8192": lambda: _pictured(_png(8192, 8192, 2), 20, copies=True),
    "a picture of 60000 by 60000": lambda: _pictured(_png(60_000, 8)[:16] + struct.pack(">II", 60_000, 60_000)),
    "a JPEG that lies": lambda: _pictured(_jpeg(65_000, 1000)),
    "5,000 scans": lambda: _pictured(_scans(5000)),
    "12 million empty chunks": lambda: _chunks(12_000_000),
    "lists of lists": lambda: _json(b"[" + b"[]," * 1_000_000 + b"0]"),
    "999,000 objects": lambda: _json(b"[" + b'{"a":{}},' * 330_000 + b"0]"),
    "a million keys": lambda: _json(b"{" + b",".join(b'"%x":0' % n for n in range(990_000)) + b"}"),
    "a million keys, one twice": lambda: _json(
        b"{" + b",".join(b'"%x":0' % (n % 980_000) for n in range(981_000)) + b"}"
    ),
    "nested lists": lambda: _json(b"[" * 900 + b"]" * 900),
    "a name of 30 million letters": lambda: _json(b'"' + b"\xf0\x9f\x98\x80" * 7_000_000 + b'"'),
    "12 million vertices": lambda: _obj(b"v 0 0 0\n" * 12_000_000 + b"f 1 2 3\n"),
    "30 million bare lines": lambda: _obj(b"v\n" * 30_000_000),
    "90 million empty lines": lambda: _obj(b"\n" * 90_000_000),
    "one line of 200 million letters": lambda: _obj(b"f" + b" 1" * 100_000_000),
    "continued lines": lambda: _obj(SQUARE + b"f 1 \\\n" * 5_000_000),
    "polygons of 1,000 corners": lambda: _obj(SQUARE + (b"f" + b" 1" * 1000 + b"\n") * 5000),
    "parts": lambda: _obj(SQUARE + b"".join(b"g p%d\nf 1 2 3\n" % n for n in range(100_000))),
    "2,000 materials with one picture": lambda: _obj(
        b"mtllib head.mtl\n" + USED, head_mtl=LIBRARY, skin_png=_png(8192, 8192)
    ),
    "one material with 40,000 pictures": lambda: _obj(
        b"mtllib head.mtl\nusemtl m\n" + SQUARE + b"f 1 2 3\n",
        head_mtl=b"newmtl m\n" + b"map_Kd skin.png\n" * 40_000,
        skin_png=_png(4096, 4096),
    ),
}
"""By what they are."""
TIER = b'"ooTextFile"\n"TextGrid"\n0\n2\n<exists>\n1\n"%s"\n"a"\n0\n2\n1\n0\n2\n"x"\n'


def _units(count: int) -> Files:
    """Return a document of so many phones, a millisecond each."""
    units = [{"start_s": n / 1000, "end_s": (n + 1) / 1000, "phone": "p", "unit": ""} for n in range(count)]
    return {"a.json": json.dumps(GOOD | {"units": units}).encode()}


def _drawing(inside: str) -> Files:
    return {"face.svg": f'<svg viewBox="0 0 9 9">{inside}<g id="mouth-rest"><path d="M0 0h1z"/></g></svg>'.encode()}


FLOODS: dict[tuple[str, str], Callable[[], Files]] = {
    ("transcript", "digits"): lambda: {"said.txt": b"9" * 20_000_000},
    ("transcript", "numbers"): lambda: {"said.txt": b"9," * 1_500_000},
    ("transcript", "short words"): lambda: {"said.txt": b"a " * 15_000_000},
    ("transcript", "phones"): lambda: {"said.txt": b"Mama. Papa?\np " + b"p " * 1_500_000},
    ("transcript", "a long word"): lambda: {"said.txt": b"ma" * 30_000_000},
    ("lexicon", "lines"): lambda: {"words.dict": b"".join(b"w%d M AA1\n" % n for n in range(40_000))},
    ("lexicon", "pronunciations of one word"): lambda: {"words.dict": b"baby B EY1 B IY0\n" * 40_000},
    ("lexicon", "phones of one word"): lambda: {"words.dict": b"baby" + b" B" * 1_000_000},
    ("lexicon", "a phone of many letters"): lambda: {"words.dict": b"baby " + b"p," * 10_000},
    ("drawing", "letters of a transform"): lambda: _drawing(f'<g transform="{"a" * 2_000_000}"/>'),
    ("drawing", "document types"): lambda: {"face.svg": b"<!DOCTYPE svg [" * 300_000},
    ("drawing", "arcs of many paths"): lambda: _drawing(f'<path d="M0 0{"a1 1 0 0 1 1 1" * 24_000}"/>' * 20),
    ("drawing", "points of one path"): lambda: _drawing(f'<path stroke="red" d="M0 0{"h1" * 399_000}"/>'),
    ("drawing", "subpaths over the picture"): lambda: _drawing(f'<path d="{"M0 0L9 9L9 0z" * 90_000}"/>'),
    ("drawing", "wide lines"): lambda: _drawing(f'<path stroke="red" stroke-width="99" d="M0 0{"h1" * 99_000}"/>'),
    ("units", "units"): lambda: _units(60_000),
    ("labels", "a word time of many letters"): lambda: {"grid.align": b"0 1 sil\n" + b"9," * 100_000},
    ("labels", "a tier's kind of many letters"): lambda: {"a.TextGrid": TIER % (b"9" * 100_000)},
    **{("character", name): made for name, made in CHARACTER_FLOODS.items()},
}
"""By reader and name."""
