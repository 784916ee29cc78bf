"""Wavefront OBJ: one mesh a file; a folder of files is a neutral mesh with its blendshapes."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened
from lipmotion.rig.limits import MOST_DISPLACEMENTS, MOST_SHAPES, MOST_TRIANGLES, MOST_VERTICES, check_count, file_bytes
from lipmotion.rig.mesh import MASK, OPAQUE, Blendshape, Material, Mesh, MeshPart
from lipmotion.rig.textures import read_texture
from lipmotion.storage.files import as_text, whole_file
from lipmotion.storage.sources import is_file

NEUTRAL = "neutral"
"""The file of a folder with this word in its name, in any case, is the mesh; the others are its blendshapes."""
LEAST_SHARE = 1e-5
"""Vertices that a blendshape moves by less than this share of the size of the mesh are not stored: OBJ files of one
head are written with rounded numbers."""
LARGEST_NUMBER = 1e9
LARGEST_LIBRARY = 1 << 20
MOST_CORNERS = 1000
"""Most corners of a polygon."""
OPAQUE_FROM = 250
"""A texture with pixels of a lower opacity than this, of 255, has holes."""
_NO_COLOUR = [b"nan"] * 3
_SHININESS = 60.0
"""A specular exponent (``Ns``) of so much is a gloss of 1/2."""


@dataclass
class _Faces:
    """Triangles so far: corners of places and of textures, and the part of each."""

    corners: list[tuple[int, int, int]] = field(default_factory=list)
    textures: list[tuple[int, int, int]] = field(default_factory=list)
    parts: list[int] = field(default_factory=list)
    names: dict[tuple[str, str], int] = field(default_factory=dict)
    here: tuple[str, str] = ("", "")

    def add(self, words: list[bytes], places: int, textures: int) -> None:
        if not 3 <= len(words) <= MOST_CORNERS:
            raise InputError(f"a polygon of {len(words)} corners, required 3 to {MOST_CORNERS}")
        part = self.names.setdefault(self.here, len(self.names))
        split = [word.split(b"/") for word in words]
        corners = [_index(each[0], places) for each in split]
        mapped = [_index(each[1], textures) if len(each) > 1 and each[1] else -1 for each in split]
        for n in range(1, len(words) - 1):
            self.corners.append((corners[0], corners[n], corners[n + 1]))
            self.textures.append((mapped[0], mapped[n], mapped[n + 1]))
            self.parts.append(part)
        check_count("triangles", len(self.corners), MOST_TRIANGLES)


def read_obj(path: Path) -> Mesh:
    """Return the mesh of an OBJ file; polygons become triangles, materials become parts.

    Vertices keep their numbers, counted from 0. Their colours (``v x y z r g b``: sRGB, 0 to 1; 0 to 255 where one is
    above 1) replace those of materials without a texture, unless all are white. Colours of materials and textures
    (``map_Kd``) come from files in the same folder, where there are some. Lines, curves and normals are ignored.
    Raises InputError: no such file, too large, no triangles, or a damaged line, whose number is named.
    """
    content = file_bytes(path, "mesh")
    places: list[list[bytes]] = []
    colours: list[list[bytes]] = []
    textures: list[list[bytes]] = []
    faces, library, number = _Faces(), "", 0
    try:
        for line in _lines(content):
            number += 1
            words = line.split()
            if not words:
                continue
            kind = words[0]
            if kind == b"v":
                places.append(words[1:4])
                colours.append(words[4:7] if len(words) == 7 else _NO_COLOUR)
            elif kind == b"vt":
                textures.append([*words[1:3], b"0"][:2])
            elif kind == b"f":
                faces.add(words[1:], len(places), len(textures))
            elif kind in {b"o", b"g"}:
                faces.here = (_text(words[1:]), faces.here[1])
            elif kind == b"usemtl":
                faces.here = (faces.here[0], _text(words[1:]))
            elif kind == b"mtllib":
                library = _text(words[1:])
        check_count("vertices", len(places), MOST_VERTICES)
        number = 0
        vertices = _numbers(places, 3)
        uv = _numbers(textures, 2)
        painted = None if all(each is _NO_COLOUR for each in colours) else _numbers(colours, 3, missing=True)
    except (InputError, ValueError, IndexError, OverflowError) as error:
        where = f" in line {number}" if number else ""
        raise InputError(f"{path}: {shortened(str(error))}{where}; export the mesh as OBJ again") from error
    if not faces.corners:
        raise InputError(f"{path}: there are no polygons in it, required a mesh; export the surface, not points alone")
    return _mesh(vertices, uv, painted, faces, _materials(path.parent, library))


def read_obj_folder(folder: Path, wanted: Callable[[str], bool] = lambda _: True) -> Mesh:
    """Return the neutral mesh of a folder of OBJ files, with the other files as blendshapes, named by their files.

    wanted : whether a blendshape of a name is read; the others are left out
    Raises InputError: no neutral mesh or several ones, a file with another number of vertices, or as ``read_obj``.
    """
    files = sorted(path for path in folder.glob("*.[oO][bB][jJ]") if not path.name.startswith("."))
    neutral = [path for path in files if NEUTRAL in path.stem.lower()]
    if len(neutral) != 1:
        raise InputError(
            f"{folder}: {len(neutral)} OBJ files have {NEUTRAL!r} in their name, required one: the mesh at rest, "
            "beside its blendshapes"
        )
    mesh = read_obj(neutral[0])
    others = [path for path in files if path != neutral[0] and wanted(path.stem)]
    check_count("blendshapes", len(others), MOST_SHAPES)
    check_count("displacements", len(others) * len(mesh.vertices), MOST_DISPLACEMENTS)
    least = LEAST_SHARE * float(np.ptp(mesh.vertices, axis=0).max())
    shapes = []
    for path in others:
        vertices = _vertices_of(path)
        if vertices.shape != mesh.vertices.shape:
            raise InputError(
                f"{path}: {len(vertices)} vertices, required {len(mesh.vertices)} as in {neutral[0].name}; "
                "move other meshes to another folder"
            )
        shapes.append(Blendshape.between(path.stem, mesh.vertices, vertices, least=least))
    return replace(mesh, shapes=tuple(shapes))


def write_obj(path: Path, mesh: Mesh, vertices: NDArray[np.float64] | None = None) -> None:
    """Write a mesh as an OBJ file, without blendshapes: give their result as ``vertices`` [shape=(V, 3)].

    Parts are written as objects, with their names. Raises ExportError: it cannot be written.
    """
    places = mesh.vertices if vertices is None else vertices
    with whole_file(path) as unfinished, unfinished.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in places.tolist())
        if mesh.uv is not None:
            file.writelines(f"vt {u:.7g} {v:.7g}\n" for u, v in mesh.uv.reshape(-1, 2).tolist())
        for part in mesh.parts:
            file.write(f"o {_one_line(part.name)}\nusemtl {_one_line(part.material.name)}\n")
            for number in range(part.first, part.stop):
                corners = (mesh.triangles[number] + 1).tolist()
                textures = range(3 * number + 1, 3 * number + 4)
                words = [f"{v}/{t}" for v, t in zip(corners, textures, strict=True)] if mesh.uv is not None else corners
                file.write(f"f {' '.join(map(str, words))}\n")


def _mesh(
    vertices: NDArray[np.float64],
    uv: NDArray[np.float64],
    painted: NDArray[np.float64] | None,
    faces: _Faces,
    materials: dict[str, Material],
) -> Mesh:
    part = np.array(faces.parts)
    order = np.argsort(part, kind="stable")
    stops = np.cumsum([0, *np.bincount(part, minlength=len(faces.names))])
    parts = tuple(
        MeshPart(group or material, int(first), int(stop), materials.get(material, Material(material)))
        for (group, material), first, stop in zip(faces.names, stops, stops[1:], strict=False)
    )
    textures = np.array(faces.textures)[order]
    mapped = np.where(textures[..., None] >= 0, uv[textures], 0.0) if len(uv) else None
    triangles = np.array(faces.corners, np.int32)[order]
    colours = _colours(painted, triangles, parts)
    return Mesh(vertices, triangles, parts, uv=mapped, colours=colours)


def _colours(
    painted: NDArray[np.float64] | None, triangles: NDArray[np.int32], parts: tuple[MeshPart, ...]
) -> NDArray[np.float64] | None:
    """Return colours of all vertices, 0 to 1 [shape=(V, 3)]; those without one have that of their material.

    None: there are none, or all are white, as programs write them that have none.
    """
    if painted is None or not (painted < 1).any():
        return None
    colours = painted / 255 if (painted > 1).any() else painted
    for part in parts:
        rows = np.unique(triangles[part.first : part.stop])
        bare = rows[np.isnan(colours[rows, 0])]
        colours[bare] = part.material.colour
    return np.clip(np.nan_to_num(colours), 0, 1)


def _vertices_of(path: Path) -> NDArray[np.float64]:
    """Return the vertices of an OBJ file, without reading its polygons [shape=(V, 3)]."""
    lines = [line.split()[1:4] for line in _lines(file_bytes(path, "mesh")) if line.startswith((b"v ", b"v\t"))]
    check_count("vertices", len(lines), MOST_VERTICES)
    try:
        return _numbers(lines, 3)
    except ValueError as error:
        raise InputError(f"{path}: {shortened(str(error))}; export the mesh as OBJ again") from error


def _numbers(rows: list[list[bytes]], width: int, *, missing: bool = False) -> NDArray[np.float64]:
    wrong = next((row for row in rows if len(row) != width), None)
    if wrong is not None:
        raise ValueError(f"{_text(wrong)!r} is no vertex of {width} numbers")
    values = np.array(rows, dtype="S32").reshape(-1, width).astype(np.float64)
    if not ((np.abs(values) <= LARGEST_NUMBER) | (missing & np.isnan(values))).all():
        raise ValueError(f"a vertex has numbers that are not finite, or beyond ±{LARGEST_NUMBER:g}")
    return values


def _index(word: bytes, count: int) -> int:
    number = int(word)
    index = number - 1 if number > 0 else count + number
    if number == 0 or not 0 <= index < count:
        raise ValueError(f"a polygon names vertex {number} of {count}")
    return index


def _lines(content: bytes) -> Iterable[bytes]:
    """Return the lines of a file; a backslash at the end of a line continues it."""
    return content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()


def _text(words: list[bytes]) -> str:
    return b" ".join(words).decode("utf-8", "replace")


def _one_line(text: str) -> str:
    return as_text(" ".join(text.split())).rstrip("\\") or "part"  # a backslash at the end continues the line


def _materials(folder: Path, library: str) -> dict[str, Material]:
    """Return the materials of an MTL file in a folder; none if the name leads elsewhere, or there is no such file."""
    if not library or Path(library).name != library or not is_file(folder / library):
        return {}
    if (folder / library).stat().st_size > LARGEST_LIBRARY:
        return {}
    found: dict[str, Material] = {}
    name = ""
    for line in _lines(file_bytes(folder / library, "material library")):
        words = line.split()
        if words[:1] == [b"newmtl"]:
            name = _text(words[1:])
            found[name] = Material(name)
        elif name and len(words) == 4 and words[0] == b"Kd":
            red, green, blue = (min(max(_number(word), 0.0), 1.0) for word in words[1:])
            found[name] = replace(found[name], colour=(red, green, blue))
        elif name and len(words) == 2 and words[0] == b"Ns":
            shininess = max(_number(words[1]), 0.0)
            found[name] = replace(found[name], gloss=shininess / (shininess + _SHININESS))
        elif name and len(words) > 1 and words[0] == b"map_Kd":
            found[name] = _with_texture(found[name], folder, _text(words[-1:]))
        elif name and len(words) > 1 and words[0] in {b"d", b"Tf"}:  # Maya writes Tf as 1 less the transparency
            found[name] = replace(found[name], opacity=min(max(_number(words[-1]), 0.0), 1.0))
    return found


def _with_texture(material: Material, folder: Path, name: str) -> Material:
    """Return a material with the picture of a name, in the same folder; where its pixels are clear, there are holes."""
    texture = None
    if Path(name).name == name and is_file(folder / name):
        texture = read_texture(file_bytes(folder / name, "picture"))
    if texture is None:
        warnings.warn(
            f"{folder / name}: a texture of the character is not in the same folder, or is no PNG, JPEG or WebP. Its "
            "surface has one colour",
            UserWarning,
            stacklevel=2,
        )
        return material
    clear = bool((texture.pixels[..., 3] < OPAQUE_FROM).any())
    return replace(material, texture=texture, alpha=MASK if clear else OPAQUE)


def _number(word: bytes) -> float:
    try:
        value = float(word)
    except ValueError:
        return 0.0
    return value if np.isfinite(value) else 0.0
