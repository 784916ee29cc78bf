import io

import numpy as np
import pytest
from PIL import Image

from lipmotion.errors import InputError
from lipmotion.meshes.files.character_files import read_obj
from lipmotion.meshes.files.gltf_scene import read_gltf
from lipmotion.meshes.model.mesh import BLEND, MASK, OPAQUE, Material, Mesh, MeshPart
from lipmotion.meshes.model.textures import Texture, read_texture, texture_table
from lipmotion_faces.rendering.drawn_surface import TexturedCanvas, drawn_surface
from lipmotion_faces.rendering.rasteriser import Camera, flat
from meshes.gltf import UV, glb, textured_document

QUARTERS = np.array([[[255, 0, 0, 255], [0, 255, 0, 255]], [[0, 0, 255, 255], [255, 255, 255, 0]]], np.uint8)
"""Red, green; blue, clear white."""


def encoded(pixels=QUARTERS, form="PNG") -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, form)
    return file.getvalue()


def textured(tmp_path, *, image: bytes | None = None, material=None, extension=None):
    """The square with a picture on it."""
    content, binary = textured_document(encoded() if image is None else image, material, extension)
    path = tmp_path / "head.glb"
    path.write_bytes(glb(content, binary))
    return read_gltf(path)


def picture_of(mesh: Mesh) -> np.ndarray:
    """The square from (0, 0) to (1, 1), 40 pixels wide, under even light, before black."""
    camera = Camera(64, 64, (0.5, 0.5), across=1.6, distance=50.0)
    drawn = drawn_surface(mesh, np.ones(len(mesh.triangles), bool), 40.0)
    canvas = TexturedCanvas(camera, drawn.triangles, flat(camera, (0, 0, 0)))
    light = np.tile(drawn.colours.astype(np.float32), (1, 1))
    return canvas.picture(mesh.vertices[drawn.rows], light, np.zeros_like(light))


def test_the_picture_of_a_gltf_lies_upright(tmp_path):
    picture = picture_of(textured(tmp_path)).astype(int)
    upper_left, upper_right, lower_left = picture[18, 18], picture[18, 46], picture[46, 18]
    assert upper_left.argmax() == 0
    assert upper_right.argmax() == 1
    assert lower_left.argmax() == 2
    assert min(upper_left.max(), upper_right.max(), lower_left.max()) > 150


@pytest.mark.parametrize(("mode", "shown"), [(OPAQUE, True), (MASK, False), (BLEND, False)])
def test_opacity_counts_as_the_material_says(tmp_path, mode, shown):
    picture = picture_of(textured(tmp_path, material={"alphaMode": mode}))
    assert (picture[42, 42].min() > 120) == shown


def test_the_place_of_a_picture_is_moved_by_its_extension(tmp_path):
    whole = picture_of(textured(tmp_path)).astype(int)
    half = {"KHR_texture_transform": {"offset": [0.5, 0.0]}}
    moved = picture_of(textured(tmp_path, extension=half)).astype(int)
    assert np.abs(moved[18, 18] - whole[18, 46]).max() < 30
    assert np.abs(moved[18, 46] - whole[18, 18]).max() < 30


def test_a_picture_that_cannot_be_read_is_a_warning_and_one_colour(tmp_path):
    with pytest.warns(UserWarning, match="texture of the character is damaged"):
        mesh = textured(tmp_path, image=b"\x89PNG no picture")
    assert mesh.parts[0].material.texture is None
    assert len(np.unique(picture_of(mesh)[18:46, 18:46].reshape(-1, 3), axis=0)) == 1


def test_two_sided_surfaces_are_seen_from_behind(tmp_path):
    for two_sided in (False, True):
        mesh = textured(tmp_path, material={"doubleSided": two_sided})
        behind = Mesh(mesh.vertices * [-1, 1, -1] + [1, 0, 0], mesh.triangles, mesh.parts, uv=mesh.uv)
        assert bool(picture_of(behind).any()) == two_sided


def test_the_picture_of_an_obj_is_that_of_its_library(tmp_path):
    (tmp_path / "skin.png").write_bytes(encoded())
    (tmp_path / "head.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd skin.png\n")
    lines = ["mtllib head.mtl", "v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    (tmp_path / "head.obj").write_text("\n".join([*lines, "usemtl skin", "f 1/1 2/2 3/3 4/4"]))
    mesh = read_obj(tmp_path / "head.obj")
    assert mesh.parts[0].material.alpha == MASK
    picture = picture_of(mesh)
    assert [int(picture[row, column].argmax()) for row, column in ((18, 18), (18, 46), (46, 18))] == [0, 1, 2]
    assert not picture[46, 46].any()


def test_a_picture_elsewhere_is_not_read(tmp_path):
    (tmp_path / "skin.png").write_bytes(encoded())
    folder = tmp_path / "head"
    folder.mkdir()
    (folder / "head.mtl").write_text("newmtl skin\nmap_Kd ../skin.png\n")
    (folder / "head.obj").write_text("mtllib head.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl skin\nf 1 2 3\n")
    with pytest.warns(UserWarning, match="not in the same folder"):
        mesh = read_obj(folder / "head.obj")
    assert mesh.parts[0].material.texture is None


def test_far_away_a_chequered_picture_is_grey():
    """Fields of one pixel, 64 of them in 40 pixels of the screen squeezed to 5."""
    board = np.indices((64, 64)).sum(axis=0) % 2
    pixels = np.dstack([*[255 * board] * 3, np.full_like(board, 255)]).astype(np.uint8)
    vertices = np.array([[0.45, 0.45, 0], [0.55, 0.45, 0], [0.55, 0.55, 0], [0.45, 0.55, 0]])
    corners = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = (UV.astype(float) * (1, -1) + (0, 1))[corners]
    mesh = Mesh(vertices, corners, (MeshPart("", 0, 2, Material("", (1, 1, 1), texture=Texture(pixels))),), uv=uv)
    inner = picture_of(mesh)[31:33, 31:33].astype(int)
    assert np.ptp(inner) <= 2
    assert 100 < inner.mean() < 240


def test_reductions_end_with_one_pixel_and_clear_pixels_do_not_colour_them():
    table = texture_table([Texture(np.repeat(np.repeat(QUARTERS, 3, axis=0), 2, axis=1))])
    assert table.levels[:, 1:].tolist() == [[4, 6], [2, 3], [1, 1]]
    clear = Texture(np.array([[[255, 0, 0, 255], [0, 255, 0, 0]]], np.uint8))
    last = texture_table([clear]).texels[-1]
    assert last.tolist() == [65535, 0, 0, 32768]


def test_opacity_in_a_box_is_never_less_or_more_than_said():
    draw = np.random.default_rng(3)
    alpha = np.where(draw.uniform(size=(32, 48)) < 0.02, 0, 255)
    texture = Texture(np.dstack([np.zeros((32, 48, 3)), alpha]).astype(np.uint8))
    low = draw.uniform(-1, 1, (200, 2))
    high = low + draw.uniform(0.01, 0.2, (200, 2))
    least, most = texture.range_of_opacity(low, high, np.ones(200, np.int64))
    inside = draw.uniform(0, 1, (50, 1, 2)) * (high - low) + low
    seen = np.stack([texture.at(each)[:, 3] for each in inside])
    assert (seen.min(axis=0) >= least).all()
    assert (seen.max(axis=0) <= most).all()
    assert 0.05 < (least > 0.9).mean() < 0.95


@pytest.mark.parametrize("content", [b"", b"GIF89a", encoded()[:40]])
def test_what_is_no_picture_is_none(content):
    assert read_texture(content) is None


def test_large_pictures_are_reduced():
    texture = read_texture(encoded(np.zeros((10, 3000, 4), np.uint8)))
    assert texture is not None
    assert texture.pixels.shape[1] == 1024


def test_a_texture_of_another_shape_is_refused():
    with pytest.raises(InputError, match=r"required \(H, W, 4\)"):
        Texture(np.zeros((2, 2, 3), np.uint8))
