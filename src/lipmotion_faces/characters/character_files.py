"""A character from its files, ready to be moved: glTF, one or several OBJ files; bindings, lip points, a table."""

from __future__ import annotations

import re
import warnings
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import LOWER_MIDDLE, UPPER_MIDDLE
from lipmotion.errors import InputError, shorten, shorten_list
from lipmotion.meshes.model.face_shapes import (
    FaceShapes,
    LipPlacement,
    find_life_scale,
    group_by_name,
    measure_lip_parting,
)
from lipmotion.meshes.model.mesh import JAW, MASK, OPAQUE, Blendshape, Material, Mesh, MeshPart, Texture
from lipmotion.meshes.model.rig_tables import RigRow, find_table, read_rig_table, suggest_names
from lipmotion.meshes.model.shape_names import (
    ARKIT_52,
    ARKIT_MOUTH,
    ARKIT_OTHERS,
    CLOSED,
    VISEMES_15,
    VRM_EMOTIONS,
    VRM_VOWELS,
    find_spoken_name,
    is_known,
    to_arkit,
)
from lipmotion.storage.sources import check_kind, is_file
from lipmotion_faces.characters.binding import (
    BINDING_SUFFIX,
    PosedCharacter,
    bind,
    load_binding,
    paint_weights,
    read_lip_points,
    read_weights,
)
from lipmotion_faces.characters.file_limits import Budget
from lipmotion_faces.characters.gltf_scene import read_gltf
from lipmotion_faces.characters.lip_placement import (
    find_opening_shape,
    place_lips_by_points,
    place_lips_by_shape,
    separate_named_lips,
)
from lipmotion_faces.characters.surface import build_surface, drop_back_sides
from lipmotion_faces.characters.textures import read_texture

SOURCES = (*ARKIT_52, *(f"viseme_{name}" for name in VISEMES_15), *VRM_VOWELS, CLOSED, *VRM_EMOTIONS)
"""The curves that blendshapes of a character may follow; besides, each what its own shape fits best: its own name."""
CLOSED_VISEME = "viseme_PP"
NEUTRAL = "neutral"
"""The file of a folder with this word in its name, in any case, is the mesh; the others are its blendshapes."""
MIN_SHARE = 1e-5
"""Vertices that a blendshape moves by less than this share of the size of the mesh are not stored: OBJ files of one
head are written with rounded numbers."""
MAX_STRETCH = 2.0  # so many times longer or shorter no expression makes the mean edge of a mesh
MIN_STILL = 0.2  # a blendshape whose shift this share of the vertices has alike is moved back
LARGEST_NUMBER = 1e9
LARGEST_LIBRARY_BYTES = 1 << 20
MAX_CORNERS = 1000  # most corners of a polygon
LONGEST_LINE = 1 << 16
MIN_OPAQUE_LEVEL = 250  # a texture with pixels of a lower opacity than this, of 255, has holes
_NO_COLOUR = (np.nan,) * 3
_SHININESS = 60.0  # the specular exponent (``Ns``) of a gloss of 1/2
_REST = rb")(?=\s|\Z)[^\r\n\\]*(?:\\(?:\r?\n)?[^\r\n\\]*)*)"
_STATEMENTS = re.compile(rb"(?:\A|(?<=[\r\n]))[ \t]*((?:v|vt|f|o|g|usemtl|mtllib" + _REST)
_LOOKS = re.compile(rb"(?:\A|(?<=[\r\n]))[ \t]*((?:newmtl|map_Kd|Kd|Ns|d|Tf" + _REST)
_VERTEX = re.compile(rb"(?:\A|[\r\n])v[ \t]([^\r\n]*)")


@dataclass
class _Surface:
    """What the lines of a file have given so far: vertices, corners of textures, triangles and their parts."""

    budget: Budget
    vertices: array[float] = field(default_factory=lambda: array("d"))
    colours: array[float] = field(default_factory=lambda: array("d"))
    textures: array[float] = field(default_factory=lambda: array("d"))
    corners: array[int] = field(default_factory=lambda: array("i"))
    mapped: array[int] = field(default_factory=lambda: array("i"))
    parts: array[int] = field(default_factory=lambda: array("i"))
    names: dict[tuple[str, str], int] = field(default_factory=dict)
    here: tuple[str, str] = ("", "")
    libraries: list[str] = field(default_factory=list)

    def add(self, kind: bytes, words: list[bytes]) -> None:
        """Add a line. Raises ValueError: it is damaged, or there are too many."""
        if kind == b"f":
            if not 3 <= len(words) <= MAX_CORNERS:
                raise InputError(f"a polygon of {len(words)} corners, required 3 to {MAX_CORNERS}")
            self.budget.spend("triangles", len(words) - 2)
            if self.here not in self.names:
                self.budget.spend("parts", 1)
                self.names[self.here] = len(self.names)
            vertices, textures = len(self.vertices) // 3, len(self.textures) // 2
            split = [word.split(b"/", 2) for word in words]
            corners = [_parse_index(each[0], vertices) for each in split]
            mapped = [_parse_index(each[1], textures) if len(each) > 1 and each[1] else -1 for each in split]
            for n in range(1, len(words) - 1):
                self.corners.extend((corners[0], corners[n], corners[n + 1]))
                self.mapped.extend((mapped[0], mapped[n], mapped[n + 1]))
                self.parts.append(self.names[self.here])
        elif kind == b"v":
            self.budget.spend("vertices", 1)
            _add_vertex(self.vertices, words)
            self.colours.extend(map(float, words[3:6]) if len(words) == 6 else _NO_COLOUR)
        elif kind == b"vt":
            self.budget.spend("corners of textures", 1)
            self.textures.extend(map(float, [*words, b"0", b"0"][:2]))
        elif kind in {b"o", b"g"}:
            self.here = (_join_words(words), self.here[1])
        elif kind == b"usemtl":
            self.here = (self.here[0], _join_words(words))
        elif kind == b"mtllib":
            named = [_join_words(words), *(_join_words([word]) for word in words)]
            self.libraries += [re.split(r"[/\\]", each)[-1] for each in named]


def read_obj(path: Path) -> Mesh:
    """Return the mesh of an OBJ file; polygons become triangles, materials become parts.

    Vertices keep their numbers, counted from 0. Their colours (``v x y z r g b``: sRGB, 0 to 1; 0 to 255 where one is
    above 1) replace those of materials without a texture, unless all are white. Colours of materials and textures
    (``map_Kd``) come from files in the same folder, where there are some. Lines, curves and normals are ignored.
    Raises InputError: no such file, too large, no triangles, or a damaged line, whose number is named.
    """
    budget = Budget()
    surface, number = _Surface(budget), 0
    try:
        for line, words in _list_lines(budget.read_bytes(path, "mesh"), _STATEMENTS, budget):
            number = line
            surface.add(words[0], words[1:])
        number = 0
        vertices, uv = _as_rows(surface.vertices, 3), _as_rows(surface.textures, 2)
        painted = _as_rows(surface.colours, 3, missing=True)
    except ValueError as error:
        raise _explain_damage(path, error, number) from error
    if not surface.corners:
        raise InputError(f"{path}: there are no polygons in it, required a mesh; export the surface, not points alone")
    used = {material for _, material in surface.names}
    materials = _read_materials(path.parent, surface.libraries, used, budget)
    part = np.array(surface.parts)
    order = np.argsort(part, kind="stable")
    stops = np.cumsum([0, *np.bincount(part, minlength=len(surface.names))])
    parts = tuple(
        MeshPart(group or material, int(first), int(stop), materials.get(material, Material(material)))
        for (group, material), first, stop in zip(surface.names, stops, stops[1:], strict=False)
    )
    textures = np.array(surface.mapped).reshape(-1, 3)[order]
    mapped = np.where(textures[..., None] >= 0, uv[textures], 0.0) if len(uv) else None
    triangles = np.array(surface.corners, np.int32).reshape(-1, 3)[order]
    if not (painted < 1).any():  # none, or all are white, as programs write them that have none
        return Mesh(vertices, triangles, parts, uv=mapped)
    colours = painted / 255 if (painted > 1).any() else painted
    for each in parts:
        rows = np.unique(triangles[each.first : each.stop])
        colours[rows[np.isnan(colours[rows, 0])]] = each.material.colour
    return Mesh(vertices, triangles, parts, uv=mapped, colours=np.clip(np.nan_to_num(colours), 0, 1))


def read_obj_folder(folder: Path, wanted: Callable[[str], bool] = lambda _: True) -> Mesh:
    """Return the neutral mesh of a folder of OBJ files, with the other files as blendshapes, named by their files.

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
    budget = Budget()
    budget.spend("blendshapes", len(others))
    smallest = MIN_SHARE * float(np.ptp(mesh.vertices, axis=0).max())
    edges, shapes, aside = mesh.triangles[:, :2], [], list[str]()
    length = np.linalg.norm(np.diff(mesh.vertices[edges], axis=1), axis=2).mean()
    for path in others:
        read, places = Budget(), array("d")  # its vertices, without reading its polygons
        try:
            for line in _VERTEX.finditer(read.read_bytes(path, "mesh")):
                read.spend("vertices", 1)
                _add_vertex(places, line[1].split())
            vertices = _as_rows(places, 3)
        except ValueError as error:
            raise _explain_damage(path, error) from error
        if vertices.shape != mesh.vertices.shape:
            raise InputError(
                f"{path}: {len(vertices)} vertices, required {len(mesh.vertices)} as in {neutral[0].name}; "
                "move other meshes to another folder"
            )
        stretch = float(np.linalg.norm(np.diff(vertices[edges], axis=1), axis=2).mean() / length)
        if not 1 / MAX_STRETCH < stretch < MAX_STRETCH:
            what = f"its edges are {stretch:.3g} times as long as in {neutral[0].name}, required about 1"
            raise InputError(f"{path}: {what}: another unit, or order of vertices? export both alike")
        change = np.median(vertices - mesh.vertices, axis=0)
        still = np.abs(vertices - mesh.vertices - change).max(axis=1) <= smallest
        if np.abs(change).max() > smallest and still.mean() > MIN_STILL:
            vertices -= change
            aside.append(path.stem)
        shapes.append(Blendshape.between(path.stem, mesh.vertices, vertices, smallest=smallest))
        budget.spend("displacements", len(shapes[-1].rows))
    if aside:
        what = f"{folder}: {len(aside)} meshes stand aside of {neutral[0].name} and are moved to it"
        warnings.warn(f"{what}: {shorten_list(aside, 4)}", stacklevel=2)
    return replace(mesh, shapes=tuple(shapes))


def _explain_damage(path: Path, error: ValueError, number: int = 0) -> InputError:
    """Return the error of a file, whose line is named where the number is not 0."""
    text = str(error)
    if text.startswith(str(path)):
        return InputError(text)
    return InputError(f"{path}: {shorten(text)}{f' in line {number}' if number else ''}; export the mesh as OBJ again")


def _list_lines(content: bytes, kinds: re.Pattern[bytes], budget: Budget) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the number of each line of some kinds, and its words; a backslash at the end of a line continues it."""
    budget.spend("lines", max(content.count(b"\n"), content.count(b"\r")))
    number, at = 1, 0
    for line in kinds.finditer(content):
        number += content.count(b"\n", at, line.start())
        at = line.start()
        if line.end() - at > LONGEST_LINE:
            raise InputError(f"a line of {line.end() - at} bytes, required at most {LONGEST_LINE}, in line {number}")
        yield number, line[1].replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").split()


def _add_vertex(vertices: array[float], words: list[bytes]) -> None:
    if len(words) < 3:
        raise ValueError(f"{_join_words(words)!r} is no vertex of 3 numbers")
    vertices.extend(map(float, words[:3]))


def _as_rows(numbers: array[float], width: int, *, missing: bool = False) -> NDArray[np.float64]:
    values = np.array(numbers).reshape(-1, width)
    if not ((np.abs(values) <= LARGEST_NUMBER) | (missing & np.isnan(values))).all():
        raise ValueError(f"a vertex has numbers that are not finite, or beyond ±{LARGEST_NUMBER:g}")
    return values


def _parse_index(word: bytes, count: int) -> int:
    number = int(word)
    index = number - 1 if number > 0 else count + number
    if number == 0 or not 0 <= index < count:
        raise ValueError(f"a polygon names vertex {shorten(_join_words([word]))} of {count}")
    return index


def _join_words(words: list[bytes]) -> str:
    return b" ".join(words).decode("utf-8", "replace")


def _read_materials(folder: Path, libraries: list[str], used: Collection[str], budget: Budget) -> dict[str, Material]:
    """Return those materials of MTL files in a folder that are used; none if there are no such files."""
    paths = dict.fromkeys(path for each in libraries if (path := _find_sibling(folder, each)))
    read = [budget.read_bytes(p, "material library") for p in paths if p.stat().st_size <= LARGEST_LIBRARY_BYTES]
    materials: dict[str, Material] = {}
    pictures: dict[str, str] = {}
    name = ""
    for _, (kind, *words) in _list_lines(b"\n".join(read), _LOOKS, budget):
        if kind == b"newmtl":
            name = _join_words(words)
            materials[name] = Material(name)
        elif name in materials and name in used and words:
            if kind == b"map_Kd":
                pictures[name] = _join_words(words[-1:])
            elif kind == b"Kd" and len(words) == 3:
                red, green, blue = (min(max(_parse_number(word), 0.0), 1.0) for word in words)
                materials[name] = replace(materials[name], colour=(red, green, blue))
            elif kind == b"Ns" and len(words) == 1:
                shininess = max(_parse_number(words[0]), 0.0)
                materials[name] = replace(materials[name], gloss=shininess / (shininess + _SHININESS))
            elif kind in {b"d", b"Tf"}:  # Maya writes Tf as 1 less the transparency
                materials[name] = replace(materials[name], opacity=min(max(_parse_number(words[-1]), 0.0), 1.0))
    textures = {picture: _read_texture(folder, picture, budget) for picture in dict.fromkeys(pictures.values())}
    for name, picture in pictures.items():
        texture = textures[picture]
        if texture is not None:
            clear = bool((texture.pixels[..., 3] < MIN_OPAQUE_LEVEL).any())  # there are holes
            materials[name] = replace(materials[name], texture=texture, alpha=MASK if clear else OPAQUE)
    return {name: material for name, material in materials.items() if name in used}


def _read_texture(folder: Path, name: str, budget: Budget) -> Texture | None:
    """Return the texture in a picture in a folder; None, and a warning, where there is none that can be read."""
    path, texture = _find_sibling(folder, name), None
    if path is not None:
        content = budget.read_bytes(path, "picture")
        budget.spend("bytes of pictures", len(content))
        texture = read_texture(content, budget)
    if texture is None:
        warnings.warn(
            f"{folder / name}: a texture of the character is not in the same folder, or is no PNG, JPEG or WebP. Its "
            "surface has one colour",
            UserWarning,
            stacklevel=2,
        )
    return texture


def _find_sibling(folder: Path, name: str) -> Path | None:
    """Return the file of a name in a folder; None if there is none, or the name leads elsewhere."""
    return folder / name if name and Path(name).name == name and is_file(folder / name) else None


def _parse_number(word: bytes) -> float:
    try:
        value = float(word)
    except ValueError:
        return 0.0
    return value if np.isfinite(value) else 0.0


GLTF_SUFFIXES = (".glb", ".gltf", ".vrm")
OBJ_SUFFIX = ".obj"
CHARACTER_SUFFIXES = (*GLTF_SUFFIXES, OBJ_SUFFIX)


def read_character(path: str | Path) -> Mesh:
    """Return the mesh of a character: a ``.glb``, ``.gltf``, ``.vrm`` or ``.obj`` file, or a folder of OBJ files.

    Of a folder, files whose names are understood as blendshapes are read (``jawOpen.obj``); if there are none, all.
    Raises InputError: another kind of file, damaged, or too large.
    """
    path = Path(path)
    if path.is_dir():
        names = [each.stem for each in path.glob("*.[oO][bB][jJ]")]
        return read_obj_folder(path, is_known if any(map(is_known, names)) else lambda _: True)
    check_kind(path, "character")
    if path.suffix.lower() in GLTF_SUFFIXES:
        return read_gltf(path)
    if path.suffix.lower() == OBJ_SUFFIX:
        return read_obj(path)
    raise InputError(
        f"{path}: a character is one of {' '.join(CHARACTER_SUFFIXES)}, or a folder of .obj files; export it as .glb"
    )


JAW_OPEN = "jawOpen"
WIDEST_RAD = np.radians(22.0)  # how far a jaw turns at weight 1
MIN_JAW_SHARE = 0.15  # a blendshape that moves less than this share of what the turn does leaves the jaw to its bone


def with_jaw(mesh: Mesh) -> Mesh:
    """Return a mesh whose mouth opens: one with a jaw bone gets the blendshape ``jawOpen``, where it has none.

    The blendshape is the movement of the jaw's vertices as the bone turns about the axis from ear to ear, on a straight
    way. It also takes the place of one that hardly moves, as Character Creator's ``Jaw_Open``, which opens the mouth
    together with the bone. Other meshes, and those without a jaw bone, are returned as they are.
    """
    bone = next((bone for bone in mesh.bones if bone.kind == JAW), None)
    if bone is None:
        return mesh
    away = mesh.vertices[bone.rows] - bone.place
    cosine, sine = np.cos(WIDEST_RAD), np.sin(WIDEST_RAD)
    turned = away @ np.array([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
    name = f"{JAW_OPEN}.001" if JAW_OPEN in mesh.shape_names else JAW_OPEN  # one that no animation of the file moves
    shape = Blendshape(name, bone.rows, bone.shares[:, None] * (turned - away))
    try:
        if np.ptp(find_opening_shape(mesh).displacements) > MIN_JAW_SHARE * np.ptp(shape.displacements):
            return mesh
    except InputError:
        pass
    return replace(mesh, shapes=(*(each for each in mesh.shapes if to_arkit(each.name) != JAW_OPEN), shape))


def read_character_table(character: Path, mesh: Mesh) -> dict[str, RigRow]:
    """Return the rows of the table beside a character, by blendshape; none without it. Raises InputError: damaged."""
    path = find_table(character)
    if not is_file(path):
        return {}
    table: dict[str, RigRow] = {}
    for row in read_rig_table(path):
        control, source = shorten(row.control), shorten(row.source)
        if row.control not in mesh.shape_names:
            near = suggest_names(row.control, mesh.shape_names)
            raise InputError(f"{path}: there is no blendshape {control!r}; {near}")
        if row.source not in {"", row.control, *SOURCES}:
            near = suggest_names(row.source, SOURCES)
            raise InputError(f"{path}: {control!r} follows {source!r}, which is no curve; {near}")
        if row.control in table:
            raise InputError(f"{path}: the blendshape {control!r} occurs twice; leave one row")
        table[row.control] = replace(row, low=max(row.low, 0.0), high=min(row.high, 1.0))
    return table


def with_sources(mesh: Mesh, table: Mapping[str, RigRow]) -> Mesh:
    """Return a mesh whose blendshapes follow the curves of a table; those without a row, what their names say."""
    sources = {name: CLOSED_VISEME if row.source == CLOSED else row.source for name, row in table.items()}
    shapes = (replace(each, source=sources[each.name]) if each.name in sources else each for each in mesh.shapes)
    return replace(mesh, shapes=tuple(shapes))


def load_character(
    path: str | Path, *, points: Path | None = None, binding: Path | None = None, by_points: bool = False
) -> PosedCharacter:
    """Return a character from its files, ready to be moved; with the table beside it, if there is one.

    path      : ``.glb``, ``.gltf``, ``.vrm``, ``.obj``, or a folder of OBJ files
    points    : a table of the vertices of lip points; None: they are found by the blendshape that opens the mouth
    binding   : a binding file, or a table of painted weights (``.csv``); both mean control points
    by_points : move it by control points, though it has blendshapes
    Raises InputError: a file is damaged, or what moves the mouth is not found in it.
    Raises ModelFormatError: the binding is damaged.
    """
    path, mesh = Path(path), with_jaw(read_character(path))
    table = read_character_table(path, mesh)
    mesh = with_sources(mesh, table)
    try:
        if binding is not None and binding.suffix.lower() == BINDING_SUFFIX:
            stored = load_binding(binding, mesh)
            return PosedCharacter(mesh, stored.placement, None, table, path, stored)
        if points is not None:
            named = read_lip_points(points)
            surface = separate_named_lips(mesh, named)
            placement = place_lips_by_points(mesh, surface, named)
        else:
            surface = build_surface(drop_back_sides(mesh))
            placement = place_lips_by_shape(mesh, surface)
        if mesh.shapes and not by_points and binding is None:
            return PosedCharacter(mesh, placement, find_face_shapes(mesh, placement), table, path)
        bound = bind(mesh, surface, placement)
        if binding is not None:
            bound = paint_weights(bound, mesh, read_weights(binding))
        return PosedCharacter(mesh, placement, None, table, path, bound)
    except InputError as error:
        text = str(error)
        raise InputError(text if str(path) in text else f"{path}: {text}") from error


MAX_DISPLACEMENT = 2.5  # eye distances by which a known blendshape of the mouth moves lips or chin at most
MIRRORED = 0.1  # eye distances that blendshapes of the left move places right of those of the right, together
MIN_DISPLACEMENT = 0.02  # a blendshape that moves no lip point by this many eye distances is none of the mouth
MAX_SHAPES = 200
MAX_REST_GAP, MIN_OPENING_GAP = 0.05, 0.08  # eye distances: of lips at rest, and at weight 1 of what opens them most


def find_face_shapes(mesh: Mesh, placement: LipPlacement) -> FaceShapes:
    """Return the blendshapes of a mesh that move the mouth.

    Visemes and vowels, where a table says what follows them; ARKit's, where the mesh has ``jawOpen`` and five more of
    them; otherwise eight visemes or three vowels; otherwise all that move lip points. Blendshapes that a table lets
    follow one curve are one of these shapes, by the name of the first.
    One motion parts the lips by the same length on all heads that are as high as people's, however wide their mouths.
    Raises InputError: none moves the mouth, or a table lets some follow visemes and others ``jawOpen``.
    """
    moved = placement.to_motion(mesh.displacements(placement.vertices))
    furthest = np.abs(moved).max(axis=(1, 2), initial=0.0)
    shapes, style = _choose_mouth(mesh, furthest > MIN_DISPLACEMENT)
    for number in [number for known, numbers in shapes for number in numbers if known]:
        if furthest[number] > MAX_DISPLACEMENT:
            what = f"the blendshape {shorten(mesh.shape_names[number])!r} moves lips or chin by {furthest[number]:.0f}"
            limit = f"required up to {MAX_DISPLACEMENT:g}: another unit, place or order of vertices? export it again"
            raise InputError(f"{what} eye distances, {limit}")
    across = mesh.vertices @ placement.axes[:, 0]
    sides = {to_arkit(each.called): float(across[each.rows].mean()) for each in mesh.shapes if len(each.rows)}
    pairs = [(sides[name], sides.get(f"{name[:-4]}Right")) for name in sides if name and name.endswith("Left")]
    if sum(left - right for left, right in pairs if right is not None) < -MIRRORED * placement.scale:
        warnings.warn("blendshapes of the left move the right side: mirrored, or turned?", UserWarning, stacklevel=2)
    if not shapes:
        there = shorten(", ".join(mesh.shape_names)) or "none"
        raise InputError(f"no blendshape moves the mouth; the mesh has {there}. Drive it by control points")
    if len(shapes) > MAX_SHAPES:
        raise InputError(
            f"{len(shapes)} blendshapes move the mouth, required at most {MAX_SHAPES}; leave some empty in its table "
            "(docs/meshes.md)"
        )
    names = tuple(mesh.shape_names[numbers[0]] for _, numbers in shapes)
    gap = measure_lip_parting(mesh, placement)
    upper, lower = (mesh.vertices[placement.vertices[placement.row(point)]] for point in (UPPER_MIDDLE, LOWER_MIDDLE))
    apart = float((upper - lower) @ placement.axes[:, 1] / find_life_scale(mesh, placement))
    if apart > MAX_REST_GAP:
        what = f"the lips of the mesh are {apart:.2f} eye distances apart at rest, required up to {MAX_REST_GAP}:"
        warnings.warn(f"{what} m, b and p stay open. Export it with a closed mouth", stacklevel=2)
    opening = [numbers for known, numbers in shapes if known in {JAW_OPEN, "viseme_aa", "vowel_aa"}]
    widest = max((float(gap[numbers].sum()) for numbers in opening), default=1.0)
    if widest < MIN_OPENING_GAP:
        what = f"the blendshape that opens the lips parts them by {widest:.2f} eye distances,"
        warnings.warn(
            f"{what} required {MIN_OPENING_GAP}: does a bone turn the jaw? Export its turn with it", stacklevel=2
        )
    return FaceShapes(
        names,
        tuple(known for known, _ in shapes),
        np.stack([moved[numbers].sum(axis=0) for _, numbers in shapes]),
        np.array([gap[numbers].sum() for _, numbers in shapes]),
        style,
    )


def _choose_mouth(mesh: Mesh, strong: NDArray[np.bool_]) -> tuple[list[tuple[str, list[int]]], str]:
    """Return the known names of the shapes of the mouth with their blendshapes, and their style."""
    spoken = group_by_name(mesh, find_spoken_name)
    arkit = {
        known: numbers
        for known, numbers in group_by_name(mesh, to_arkit).items()
        if known in ARKIT_MOUTH and len(mesh.shapes[numbers[0]].rows)
    }
    jaw = arkit.get("jawOpen", [])
    stated = [known for known, numbers in spoken.items() if mesh.shapes[numbers[0]].source]
    if stated and any(mesh.shapes[number].source for number in jaw):
        raise InputError(
            f"its table has jawOpen and {stated[0].removeprefix('vowel_')}; leave the sources of one kind empty"
        )
    if stated:
        return [(known, spoken[known]) for known in stated], "visemes"
    if strong[jaw].any() and len(arkit) > 5 and arkit.keys() & {"mouthPucker", "mouthFunnel"}:
        return list(arkit.items()), "arkit"
    for kind, enough in (("viseme_", 8), ("vowel_", 3)):
        those = {
            known: numbers
            for known, numbers in spoken.items()
            if known.startswith(kind) and (strong[numbers].any() or known == "viseme_PP")
        }
        if len(those) >= enough and f"{kind}aa" in those:
            return list(those.items()), "visemes"
    moving = [(known, numbers) for known, numbers in arkit.items() if strong[numbers].any()]
    named = {number for _, numbers in moving for number in numbers}
    unknown = []
    for number in np.flatnonzero(strong).tolist():
        name = mesh.shapes[number].called
        if name and number not in named and {to_arkit(name), name.lower()}.isdisjoint({*ARKIT_OTHERS, *VRM_EMOTIONS}):
            moving.append(("", [number]))
            if not is_known(name) and mesh.shapes[number].source is None:
                unknown.append(name)
    if unknown:
        what = f"{len(unknown)} blendshapes of unknown names move with speech as they fit: {shorten_list(unknown, 8)}."
        do = "Empty the source of those that should not, in its table (lipmotion character FILE --write-table)"
        warnings.warn(f"{what} {do}", stacklevel=3)
    return sorted(moving, key=lambda each: each[1]), "own"
