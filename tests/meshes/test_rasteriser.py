import io

import numpy as np
import pytest
from PIL import Image

from lipmotion.errors import InputError
from lipmotion.meshes.model.mesh import BLEND, MASK, OPAQUE, Material, Mesh, MeshPart, Texture
from lipmotion_faces.characters import character_files, gltf_scene, textures
from lipmotion_faces.characters.surface import compute_normals
from lipmotion_faces.characters.textures import decode_srgb
from lipmotion_faces.rendering.drawn_surface import Camera, Canvas, TexturedCanvas, fill, fill_gradient, prepare_surface
from lipmotion_faces.rendering.lighting import Finish, Lighting, measure_reach
from meshes.gltf import UV, document, glb, textured_document, with_colours

CAMERA = Camera(120, 100, (0.5, -0.25), across=2.0, distance=8.0)


def ball(rows: int = 24, columns: int = 36, radius: float = 0.5) -> Mesh:
    down, around = np.meshgrid(np.linspace(0, np.pi, rows), 2 * np.pi * np.arange(columns) / columns, indexing="ij")
    places = np.stack([np.sin(down) * np.cos(around), np.cos(down), np.sin(down) * np.sin(around)], axis=-1)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1], np.roll(index[:-1], -1, 1), np.roll(index[1:], -1, 1), index[1:]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)
    part = MeshPart("ball", 0, len(triangles), Material("", (0.9, 0.2, 0.1), 0.3))
    return Mesh(radius * places.reshape(-1, 3), triangles, (part,))


def picture_of(mesh: Mesh, camera: Camera) -> np.ndarray:
    """A picture of a mesh, each part in the colour and gloss of its material."""
    vertices = mesh.vertices
    colours, kinds = np.zeros_like(vertices), np.zeros(len(vertices), np.intp)
    for number, part in enumerate(mesh.parts):
        rows = np.unique(mesh.triangles[part.first : part.stop])
        colours[rows], kinds[rows] = decode_srgb(part.material.colour), number
    glosses = [part.material.gloss for part in mesh.parts]
    lighting = Lighting([Finish((0.3, 0.2, 0.15), gloss=0.5 * gloss, focus=4 + round(2 * gloss)) for gloss in glosses])
    light = lighting.shade(vertices, compute_normals(vertices, mesh.triangles), colours, kinds, camera.place)
    return Canvas(camera).draw(vertices, light, mesh.triangles)


def test_the_height_of_the_picture_is_as_stated_and_nearer_things_are_larger():
    assert CAMERA.project(np.array([[0.5, -0.25, 0.0]]))[0][:2] == pytest.approx((60, 50))
    low, high, near = CAMERA.project(np.array([[0.5, -1.25, 0.0], [0.5, 0.75, 0.0], [0.5, 0.75, 1.0]]))
    assert low[1] - high[1] == pytest.approx(100)
    assert near[1] < high[1]
    assert near[2] < high[2]
    light = fill_gradient(Camera(100, 100))  # the background is brightest in the middle
    assert light[42, 50].sum() > light[5, 5].sum()
    for size in ((63, 100), (120, 62), (120, 101)):
        with pytest.raises(InputError, match="even number of at least 64"):
            Camera(*size)
    with pytest.raises(InputError, match="required more than 0"):
        Camera(100, 100, distance=0.0)


def test_a_mesh_is_seen_in_its_colour_at_its_place():
    picture = picture_of(ball(), Camera(100, 100, across=2.0)).astype(int)
    red, green, blue = picture[50, 50]
    assert red > 2 * max(green, blue)
    assert (picture[..., 0] > 1.5 * picture[..., 2]).sum() == pytest.approx(np.pi * 25**2, rel=0.06)


def test_the_edge_of_what_is_cut_out_is_as_light_as_its_middle():
    """Straight alpha: over black, a pixel that is covered in part has its part of the light."""
    mesh, camera = ball(), Camera(100, 100, across=2.0)
    canvas = Canvas(camera, fill(camera, (0, 0, 0)))
    light = np.full((len(mesh.vertices), 3), 0.5, np.float32)
    seen = canvas.cut_out(mesh.vertices, light, mesh.triangles).astype(int)
    inside, edge = seen[..., 3] == 255, (seen[..., 3] > 60) & (seen[..., 3] < 255)
    assert edge.sum() > 50
    assert np.ptp(seen[inside][:, :3]) == 0
    assert np.abs(seen[edge][:, :3] - seen[50, 50, :3]).max() <= 6


def test_drawing_the_moving_part_alone_gives_the_whole_picture():
    mesh, canvas = ball(), Canvas(CAMERA)
    still = mesh.vertices + np.array([-0.3, 0.2, -1.0])
    moving = 0.4 * mesh.vertices + np.array([0.8, -0.5, 0.5])
    both = np.concatenate([still, moving])
    light = np.random.default_rng(1).uniform(0, 1, both.shape).astype(np.float32)
    triangles = np.concatenate([mesh.triangles, mesh.triangles + len(still)]).astype(np.int32)
    base = canvas.draw(both, light, triangles[: len(mesh.triangles)])
    part = canvas.draw(both, light, triangles, onto=base, moving=slice(len(still), None))
    assert np.array_equal(part, canvas.draw(both, light, triangles))
    assert not np.array_equal(part, base)


def test_a_floor_under_a_roof_gets_less_light_than_the_floor_beside_it():
    x, z = np.meshgrid(np.linspace(-1, 1, 61), np.linspace(-1, 1, 61))
    floor = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)
    roof = np.array([0.4, 0.5, 0.4]) * floor + [0, 0.3, 0]
    places = np.concatenate([floor, roof])
    normals = np.broadcast_to([0.0, 1.0, 0.0], places.shape)
    index = np.arange(61 * 61).reshape(61, 61)
    a, b, c = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel()
    triangles = np.stack([a, b, c], axis=1).astype(np.int32)
    sky, key = measure_reach(places, normals, triangles, np.ones(len(places), bool)).T[:, : 61 * 61]
    under = (np.abs(floor[:, 0]) < 0.15) & (np.abs(floor[:, 2]) < 0.15)
    beside = (floor[:, 0] > 0.8) & (floor[:, 2] > 0.8)
    assert sky[under].max() < 0.6 * sky[beside].min()
    assert key[beside].min() > 0.9
    shaded = floor[key < 0.5]
    assert len(shaded)
    assert shaded[:, 0].mean() > 0  # the key light comes from -x: shadows fall towards +x


QUARTERS = np.array([[[255, 0, 0, 255], [0, 255, 0, 255]], [[0, 0, 255, 255], [255, 255, 255, 0]]], np.uint8)
"""Red, green; blue, clear white."""


def encoded(pixels=QUARTERS, form="PNG") -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, form)
    return file.getvalue()


def textured(tmp_path, *, image: bytes | None = None, material=None, extension=None):
    """The square with a picture on it."""
    return _read(tmp_path, *textured_document(encoded() if image is None else image, material, extension))


def square_picture(mesh: Mesh) -> np.ndarray:
    """The square from (0, 0) to (1, 1), 40 pixels wide, under even light, before black."""
    camera = Camera(64, 64, (0.5, 0.5), across=1.6, distance=50.0)
    drawn = prepare_surface(mesh, np.ones(len(mesh.triangles), bool), 40.0)
    canvas = TexturedCanvas(camera, drawn.triangles, fill(camera, (0, 0, 0)))
    light = np.tile(drawn.colours.astype(np.float32), (1, 1))
    return canvas.draw(mesh.vertices[drawn.rows], light, np.zeros_like(light))


def test_the_picture_of_a_gltf_lies_upright(tmp_path):
    picture = square_picture(textured(tmp_path)).astype(int)
    upper_left, upper_right, lower_left = picture[18, 18], picture[18, 46], picture[46, 18]
    assert upper_left.argmax() == 0
    assert upper_right.argmax() == 1
    assert lower_left.argmax() == 2
    assert min(upper_left.max(), upper_right.max(), lower_left.max()) > 150


@pytest.mark.parametrize(("mode", "shown"), [(OPAQUE, True), (MASK, False), (BLEND, False)])
def test_opacity_counts_as_the_material_says(tmp_path, mode, shown):
    assert (square_picture(textured(tmp_path, material={"alphaMode": mode}))[42, 42].min() > 120) == shown


def test_the_place_of_a_picture_is_moved_by_its_extension(tmp_path):
    whole = square_picture(textured(tmp_path)).astype(int)
    half = {"KHR_texture_transform": {"offset": [0.5, 0.0]}}
    moved = square_picture(textured(tmp_path, extension=half)).astype(int)
    assert np.abs(moved[18, 18] - whole[18, 46]).max() < 30
    assert np.abs(moved[18, 46] - whole[18, 18]).max() < 30


def test_a_picture_that_cannot_be_read_is_a_warning_and_one_colour(tmp_path):
    with pytest.warns(UserWarning, match="texture of the character is damaged"):
        mesh = textured(tmp_path, image=b"\x89PNG no picture")
    assert mesh.parts[0].material.texture is None
    assert len(np.unique(square_picture(mesh)[18:46, 18:46].reshape(-1, 3), axis=0)) == 1


def test_two_sided_surfaces_are_seen_from_behind(tmp_path):
    for two_sided in (False, True):
        mesh = textured(tmp_path, material={"doubleSided": two_sided})
        behind = Mesh(mesh.vertices * [-1, 1, -1] + [1, 0, 0], mesh.triangles, mesh.parts, uv=mesh.uv)
        assert bool(square_picture(behind).any()) == two_sided


def test_the_picture_of_an_obj_is_that_of_its_library_in_the_same_folder(tmp_path):
    (tmp_path / "skin.png").write_bytes(encoded())
    (tmp_path / "head.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd skin.png\n")
    lines = ["mtllib head.mtl", "v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    (tmp_path / "head.obj").write_text("\n".join([*lines, "usemtl skin", "f 1/1 2/2 3/3 4/4"]))
    mesh = character_files.read_obj(tmp_path / "head.obj")
    assert mesh.parts[0].material.alpha == MASK
    picture = square_picture(mesh)
    assert [int(picture[row, column].argmax()) for row, column in ((18, 18), (18, 46), (46, 18))] == [0, 1, 2]
    assert not picture[46, 46].any()
    (tmp_path / "head.mtl").write_text("newmtl skin\nmap_Kd ../skin.png\n")
    (tmp_path.parent / "skin.png").write_bytes(encoded())
    with pytest.warns(UserWarning, match="not in the same folder"):
        assert character_files.read_obj(tmp_path / "head.obj").parts[0].material.texture is None


def test_far_away_a_chequered_picture_is_grey():
    """Fields of one pixel, 64 of them in 40 pixels of the screen squeezed to 5."""
    board = np.indices((64, 64)).sum(axis=0) % 2
    pixels = np.dstack([*[255 * board] * 3, np.full_like(board, 255)]).astype(np.uint8)
    vertices = np.array([[0.45, 0.45, 0], [0.55, 0.45, 0], [0.55, 0.55, 0], [0.45, 0.55, 0]])
    corners = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = (UV.astype(float) * (1, -1) + (0, 1))[corners]
    mesh = Mesh(vertices, corners, (MeshPart("", 0, 2, Material("", (1, 1, 1), texture=Texture(pixels))),), uv=uv)
    inner = square_picture(mesh)[31:33, 31:33].astype(int)
    assert np.ptp(inner) <= 2
    assert 100 < inner.mean() < 240


def test_reductions_end_with_one_pixel_and_clear_pixels_do_not_colour_them():
    table = textures.reduce_textures([Texture(np.repeat(np.repeat(QUARTERS, 3, axis=0), 2, axis=1))])
    assert table.levels[:, 1:].tolist() == [[4, 6], [2, 3], [1, 1]]
    clear = Texture(np.array([[[255, 0, 0, 255], [0, 255, 0, 0]]], np.uint8))
    last = textures.reduce_textures([clear]).texels[-1]
    assert last.tolist() == [65535, 0, 0, 32768]


def test_opacity_in_a_box_is_never_less_or_more_than_said():
    draw = np.random.default_rng(3)
    alpha = np.where(draw.uniform(size=(32, 48)) < 0.02, 0, 255)
    texture = Texture(np.dstack([np.zeros((32, 48, 3)), alpha]).astype(np.uint8))
    low = draw.uniform(-1, 1, (200, 2))
    high = low + draw.uniform(0.01, 0.2, (200, 2))
    least, most = textures.find_opacity_range(texture, low, high, np.ones(200, np.int64))
    inside = draw.uniform(0, 1, (50, 1, 2)) * (high - low) + low
    seen = np.stack([textures.find_pixels(texture, each)[:, 3] for each in inside])
    assert (seen.min(axis=0) >= least).all()
    assert (seen.max(axis=0) <= most).all()
    assert 0.05 < (least > 0.9).mean() < 0.95


@pytest.mark.parametrize("content", [b"", b"GIF89a", encoded()[:40]])
def test_what_is_no_picture_is_none_and_large_ones_are_reduced(content):
    assert textures.read_texture(content) is None
    assert textures.read_texture(encoded(np.zeros((10, 3000, 4), np.uint8))).pixels.shape[1] == 1024
    with pytest.raises(InputError, match=r"required \(H, W, 4\)"):
        Texture(np.zeros((2, 2, 3), np.uint8))


LIGHT = np.array([[1.0, 0.0, 0.5], [0.2, 1.0, 0.0], [0.0, 0.25, 1.0], [0.75, 0.5, 0.0]])
CLEAR = np.concatenate([np.tile([1.0, 0.5, 0.25], (4, 1)), np.array([[0.6], [0.0], [0.6], [1.0]])], axis=1)
"""The mean opacity of the lower right triangle is 0.4, that of the upper left one 0.73."""
SQUARE = "f 1 2 3\nf 1 3 4\n"
FULL = {"<f4": 1, "u1": 255, "<u2": 65535}


def _read(tmp_path, content, binary):
    (tmp_path / "head.glb").write_bytes(glb(content, binary))
    return gltf_scene.read_gltf(tmp_path / "head.glb")


def _coloured(tmp_path, colours, material=None, *, normalised=False):
    content, binary = with_colours(*document(), colours, normalised=normalised)
    if material is not None:
        content["materials"] = [material]
        content["meshes"][0]["primitives"][0]["material"] = 0
    return _read(tmp_path, content, binary)


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize(("kind", "normalised"), [("<f4", False), ("u1", True), ("<u2", True), ("u1", False)])
def test_colours_of_every_kind_are_read_as_light(tmp_path, kind, normalised, width):
    given = np.concatenate([LIGHT, np.ones((4, 1))], axis=1)[:, :width] * FULL[kind]
    mesh = _coloured(tmp_path, (given if kind == "<f4" else np.rint(given)).astype(kind), normalised=normalised)
    np.testing.assert_allclose(textures.decode_srgb(mesh.colours), LIGHT, atol=0.003)


def test_colours_are_multiplied_by_that_of_the_material_and_white_at_most(tmp_path):
    factor = [0.5, 1.0, 0.25, 1.0]
    mesh = _coloured(tmp_path, LIGHT.astype("<f4"), {"pbrMetallicRoughness": {"baseColorFactor": factor}})
    np.testing.assert_allclose(textures.decode_srgb(mesh.colours), LIGHT * factor[:3], atol=1e-6)
    mesh = _coloured(tmp_path, (LIGHT * 4).astype("<f4"))
    np.testing.assert_allclose(textures.decode_srgb(mesh.colours), np.minimum(LIGHT * 4, 1), atol=1e-6)


def test_a_texture_is_multiplied_by_colours(tmp_path):
    white = encoded(np.full((2, 2, 4), 255, np.uint8))
    plain = square_picture(_read(tmp_path, *textured_document(white)))[32, 32]
    red = np.tile([1.0, 0.2, 0.0], (4, 1)).astype("<f4")
    tinted = square_picture(_read(tmp_path, *with_colours(*textured_document(white), red)))[32, 32]
    assert tinted[0] == plain[0]
    assert 0 < tinted[1] < plain[1]
    assert tinted[2] == 0


@pytest.mark.parametrize("mode", [OPAQUE, MASK, BLEND])
@pytest.mark.parametrize("textured", [False, True])
def test_opacity_of_colours_counts_as_the_material_says(tmp_path, mode, textured):
    material = {"alphaMode": mode}
    if textured:
        white = encoded(np.full((2, 2, 4), 255, np.uint8))
        mesh = _read(tmp_path, *with_colours(*textured_document(white, material), CLEAR.astype("<f4")))
    else:
        mesh = _coloured(tmp_path, CLEAR.astype("<f4"), material)
    picture = square_picture(mesh).astype(int)
    lower, upper, whole = picture[38, 46, 0], picture[26, 18, 0], 0.8 * 255
    if mode == OPAQUE:
        assert min(lower, upper) > whole
    elif mode == MASK:
        assert lower == 0
        assert upper > whole
    else:
        assert 0 < lower < upper < lower + 100


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda accessor: accessor.update(componentType=5122), "required VEC3 or VEC4"),
        (lambda accessor: accessor.update(type="VEC2"), "required VEC3 or VEC4"),
        (lambda accessor: accessor.update(count=3), "an array of 3 elements, required 4"),
    ],
)
def test_colours_that_do_not_fit_are_refused(tmp_path, change, message):
    content, binary = with_colours(*document(), LIGHT.astype("<f4"))
    change(content["accessors"][-1])
    with pytest.raises(InputError, match=message):
        _read(tmp_path, content, binary)


def test_colours_of_obj_vertices(tmp_path):
    rows = ["v 0 0 0 1 0 0.5", "v 1 0 0 0 1 0", "v 1 1 0", "v 0 1 0 0 0 1"]
    (tmp_path / "neutral.obj").write_text("\n".join(rows) + "\n" + SQUARE)
    mesh = character_files.read_obj(tmp_path / "neutral.obj")
    np.testing.assert_allclose(mesh.colours, [[1, 0, 0.5], [0, 1, 0], mesh.parts[0].material.colour, [0, 0, 1]])
    np.testing.assert_allclose(character_files.read_obj_folder(tmp_path).colours, mesh.colours)
    (tmp_path / "a.obj").write_text("v 0 0 0 255 0 51\nv 1 0 0 0 255 0\nv 1 1 0 0 0 0\nv 0 1 0 0 0 0\n" + SQUARE)
    np.testing.assert_allclose(character_files.read_obj(tmp_path / "a.obj").colours[0], [1, 0, 0.2])
    (tmp_path / "a.obj").write_text("v 0 0 0 red 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + SQUARE)
    with pytest.raises(InputError, match="export the mesh as OBJ again"):
        character_files.read_obj(tmp_path / "a.obj")


@pytest.mark.parametrize("colour", ["", " 1 1 1", " 1.0"])
def test_obj_vertices_without_colours_or_all_white_have_those_of_materials(tmp_path, colour):
    places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    (tmp_path / "a.obj").write_text("".join(f"v {place}{colour}\n" for place in places) + SQUARE)
    assert character_files.read_obj(tmp_path / "a.obj").colours is None
