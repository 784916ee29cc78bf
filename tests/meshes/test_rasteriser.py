import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.model.mesh import Material, Mesh, MeshPart
from lipmotion.meshes.model.surface import compute_normals
from lipmotion_faces.characters.textures import decode_srgb
from lipmotion_faces.rendering.drawn_surface import Camera, Canvas, flat, gradient
from lipmotion_faces.rendering.lighting import Finish, Lighting, reaches

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
    light = lighting.light(vertices, compute_normals(vertices, mesh.triangles), colours, kinds, camera.place)
    return Canvas(camera).picture(vertices, light, mesh.triangles)


def test_the_height_of_the_picture_is_as_stated_and_nearer_things_are_larger():
    centre = np.array([[0.5, -0.25, 0.0]])
    assert CAMERA.on_screen(centre)[0][:2] == pytest.approx((60, 50))
    low, high, near = CAMERA.on_screen(np.array([[0.5, -1.25, 0.0], [0.5, 0.75, 0.0], [0.5, 0.75, 1.0]]))
    assert low[1] - high[1] == pytest.approx(100)
    assert near[1] < high[1]
    assert near[2] < high[2]
    light = gradient(Camera(100, 100))  # the background is brightest in the middle
    assert light[42, 50].sum() > light[5, 5].sum()
    for size in ((63, 100), (120, 62), (120, 101)):
        with pytest.raises(InputError, match="even number of at least 64"):
            Camera(*size)
    with pytest.raises(InputError, match="required more than 0"):
        Camera(100, 100, distance=0.0)


def test_normals_of_a_ball_point_outwards():
    mesh = ball()
    inner = np.abs(mesh.vertices[:, 1]) < 0.45
    outward = mesh.vertices[inner] / np.linalg.norm(mesh.vertices[inner], axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", compute_normals(mesh.vertices, mesh.triangles)[inner], outward).min() > 0.99


def test_a_mesh_is_seen_in_its_colour_at_its_place():
    picture = picture_of(ball(), Camera(100, 100, across=2.0)).astype(int)
    red, green, blue = picture[50, 50]
    assert red > 2 * max(green, blue)
    reddish = (picture[..., 0] > 1.5 * picture[..., 2]).sum()
    assert reddish == pytest.approx(np.pi * 25**2, rel=0.06)


def test_the_edge_of_what_is_cut_out_is_as_light_as_its_middle():
    """Straight alpha: over black, a pixel that is covered in part has its part of the light."""
    mesh, camera = ball(), Camera(100, 100, across=2.0)
    canvas = Canvas(camera, flat(camera, (0, 0, 0)))
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
    base = canvas.picture(both, light, triangles[: len(mesh.triangles)])
    part = canvas.picture(both, light, triangles, onto=base, moving=slice(len(still), None))
    assert np.array_equal(part, canvas.picture(both, light, triangles))
    assert not np.array_equal(part, base)


def test_marked_vertices_are_found_where_they_can_be_seen():
    mesh, canvas = ball(), Canvas(Camera(100, 100, across=2.0))
    marked = mesh.vertices[:, 0] > 0
    seen = canvas.shown(mesh.vertices, marked, mesh.triangles)
    assert seen[50, 60]
    assert not seen[50, 40]
    assert seen.sum() == pytest.approx(0.5 * np.pi * 25**2, rel=0.1)


def test_a_floor_under_a_roof_gets_less_light_than_the_floor_beside_it():
    x, z = np.meshgrid(np.linspace(-1, 1, 61), np.linspace(-1, 1, 61))
    floor = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)
    roof = np.array([0.4, 0.5, 0.4]) * floor + [0, 0.3, 0]
    places = np.concatenate([floor, roof])
    normals = np.broadcast_to([0.0, 1.0, 0.0], places.shape)
    index = np.arange(61 * 61).reshape(61, 61)
    a, b, c = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel()
    triangles = np.stack([a, b, c], axis=1).astype(np.int32)
    sky, key = reaches(places, normals, triangles, np.ones(len(places), bool)).T[:, : 61 * 61]
    under = (np.abs(floor[:, 0]) < 0.15) & (np.abs(floor[:, 2]) < 0.15)
    beside = (floor[:, 0] > 0.8) & (floor[:, 2] > 0.8)
    assert sky[under].max() < 0.6 * sky[beside].min()
    assert key[beside].min() > 0.9
    shaded = floor[key < 0.5]
    assert len(shaded)
    assert shaded[:, 0].mean() > 0  # the key light comes from -x: shadows fall towards +x
