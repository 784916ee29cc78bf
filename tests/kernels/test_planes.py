import numpy as np

from lipmotion_faces.kernels import painting, planes
from lipmotion_faces.kernels.planes import Box, EyeLayers, StillLayers

HEIGHT, WIDTH = 60, 84


def shifts(rng: np.random.Generator, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return shifts of some pixels that change smoothly, with some noise."""
    y, x = np.mgrid[: -(-height // planes.STEP) + 1, : -(-width // planes.STEP) + 1]
    noise = rng.normal(0, 0.3, (2, *y.shape))
    return 3.3 + 0.08 * x + 0.16 * y + noise[0], -2.2 + 0.12 * x - 0.08 * y + noise[1]


def packed(pictures: np.ndarray, box: Box | None = None) -> np.ndarray:
    """Return planes packed, all but the first one as means."""
    result = np.zeros(pictures.shape, np.uint32)
    for number, plane in enumerate(pictures):
        planes.pack(plane, *(box or Box(0, 0, *plane.shape)), number > 0, result[number])
    return result


def empty_target() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    colours = np.zeros((2, HEIGHT // 2, WIDTH // 2), np.uint8)
    return np.zeros((HEIGHT, WIDTH), np.uint8), colours[0], colours[1]


def layers(rng: np.random.Generator, height: int, width: int) -> StillLayers:
    """Return layers in front of whose left third there is hair."""
    above = (rng.uniform(0, 0.4, (4, height, width)) * np.array([200, 200, 200, 1])[:, None, None]).astype(np.float32)
    above[:, :, width // 3 :] = 0
    below, shade = rng.uniform(20, 100, (3, height, width)), rng.uniform(-20, 0, (3, height, width))
    return StillLayers(below.astype(np.float32), shade.astype(np.float32), above)


def eyes(rng: np.random.Generator, height: int, width: int) -> EyeLayers:
    def layer(share: float) -> np.ndarray:
        drawn = rng.uniform(0, 1, (height, width, 1)) < share
        return (rng.uniform(0, 1, (height, width, 4)) * [60, 60, 60, 1] * drawn).astype(np.float32)

    opening = np.maximum(rng.uniform(-1, 1, (height, width)), 0).astype(np.float32)
    return EyeLayers(layer(0.7), opening, layer(0.5), layer(1))


def test_a_packed_pixel_is_followed_by_its_neighbours():
    plane = np.arange(12, dtype=np.uint8).reshape(3, 4)
    found = packed(plane[None])[0]
    assert [found[0, 1] >> bits & 255 for bits in (0, 8, 16, 24)] == [1, 2, 5, 6]
    assert [found[2, 3] >> bits & 255 for bits in (0, 8, 16, 24)] == [11, 11, 11, 11]  # the last pixel goes on


def test_a_warp_of_planes_is_that_of_pictures():
    rng = np.random.default_rng(3)
    pictures = rng.integers(0, 256, (3, HEIGHT, WIDTH), np.uint8)
    x, y = shifts(rng, HEIGHT, WIDTH)
    target, expected = empty_target(), np.empty((HEIGHT, WIDTH, 4), np.uint8)
    planes.warp_planes(packed(pictures), 0, 0, HEIGHT, WIDTH, x, y, *target)
    source = np.dstack([*pictures, pictures[0]]).astype(np.uint16)
    painting.warp_bytes(source, x, y, planes.STEP, expected)
    # warp_bytes rounds shares of pairs of pixels to 1/256 as well: four of them, of up to 255 levels
    assert np.abs(target[0].astype(int) - expected[..., 0]).max() <= 2


def test_colours_have_half_the_pixels_and_are_means():
    rng = np.random.default_rng(4)
    pictures, target = rng.integers(0, 256, (3, HEIGHT, WIDTH), np.uint8), empty_target()
    still = np.zeros((HEIGHT // planes.STEP + 2, WIDTH // planes.STEP + 2))
    planes.warp_planes(packed(pictures), 0, 0, HEIGHT, WIDTH, still, still, *target)
    means = pictures.reshape(3, HEIGHT // 2, 2, WIDTH // 2, 2).mean(axis=(2, 4))
    assert np.array_equal(target[0][:-1, :-1], pictures[0, :-1, :-1])
    for number in (1, 2):
        assert np.abs(target[number][:-1, :-1] - means[number, :-1, :-1]).max() <= 0.51


def test_only_the_box_is_changed():
    rng = np.random.default_rng(5)
    pictures, target = rng.integers(1, 256, (3, HEIGHT, WIDTH), np.uint8), empty_target()
    box = Box(8, 12, 40, 72)
    planes.warp_planes(packed(pictures), *box, *shifts(rng, 32, 60), *target)
    assert target[0][box.area].all()
    outside = target[0].copy()
    outside[box.area] = 0
    assert not outside.any()
    assert target[1][4:20, 6:36].all()
    assert not target[1][20:].any()
    assert not target[1][:, 36:].any()


def packed_skin(skin: np.ndarray) -> np.ndarray:
    into = np.zeros(skin.shape, np.uint32)
    for plane, here in zip(skin, into, strict=True):
        planes.pack(plane, 0, 0, *plane.shape, False, here)
    return into


def between(skin: np.ndarray, around: StillLayers, inside: tuple[slice, ...] = np.s_[:, :, :]) -> np.ndarray:
    """Return what is seen of skin and its layers."""
    below, shade, above = (layer[inside] for layer in around)
    seen = skin[:3] + (1 - skin[3] / 255) * (below + skin[4] / 255 * shade)
    return above[:3] + (1 - above[3]) * seen


def test_skin_at_rest_lies_between_its_layers():
    rng = np.random.default_rng(6)
    around, still = layers(rng, 24, 40), np.zeros((4, 6))
    skin = rng.integers(0, 100, (5, 24, 40), np.uint8)
    target = np.zeros((3, 30, 50), np.uint8)
    planes.lay_skin(packed_skin(skin), still, still, *around, 2, 4, target)
    inside = np.s_[:, :-1, :-1]
    assert np.abs(target[:, 2:26, 4:44].astype(float) - between(skin, around))[inside].max() <= 0.51
    assert not target[:, :2].any()
    assert not target[:, 26:].any()


def test_irises_are_seen_only_between_the_lids():
    clear, iris = np.zeros((8, 12, 4), np.float32), np.zeros((8, 12, 4), np.float32)
    white, opening = np.full_like(clear, 200), np.zeros((8, 12), np.float32)
    white[..., 3], opening[2:6], iris[:, 5] = 1, 1, (50, 60, 70, 1)
    target = np.zeros((3, 10, 20), np.uint8)
    planes.lay_eyes(*EyeLayers(white, opening, clear, iris), np.float32(-2), np.float32(0), 1, 3, target)
    assert target[:, 1 + 3, 3 + 7].tolist() == [50, 60, 70]  # two pixels to the right of where it is at rest
    assert (target[:, 1 + 1, 3:15] == 200).all()
    assert not target[:, 9].any()


def test_a_layer_goes_to_planes_and_back() -> None:
    pictures = np.random.default_rng(7).integers(0, 256, (3, 30, 40), np.uint8)
    layer, again = np.zeros((15, 28, 4), np.float32), np.zeros((3, 30, 40), np.uint8)
    planes.to_layer(pictures, 4, 6, layer)
    assert np.array_equal(layer[..., 3], np.ones((15, 28)))
    planes.from_layer(layer * np.float32(0.998), 5, 8, again)
    wanted = (pictures[:, 4:19, 6:34] * np.float32(0.998) + np.float32(0.5)).astype(np.uint8)
    assert np.array_equal(again[:, 5:20, 8:36], wanted)
    assert not again[:, :5].any()


def test_skin_that_moves_is_a_mean_of_its_pixels_between_its_layers() -> None:
    rng = np.random.default_rng(8)
    around, skin = layers(rng, 40, 70), rng.integers(0, 100, (5, 40, 70), np.uint8)
    skin[3, :20] = 255  # nothing but skin is seen there, where no hair is
    target, x, y, grid = np.zeros((3, 50, 80), np.uint8), 1.25, -2.5, np.ones((6, 10))
    planes.lay_skin(packed_skin(skin), x * grid, y * grid, *around, 3, 5, target)
    rows, columns = np.arange(4, 36), np.arange(2, 66)
    moved = sum(
        weight * skin[:, rows[:, None] - 3 + down, columns[None] + 1 + right].astype(float)
        for down in (0, 1)
        for right, weight in enumerate((0.5 * 0.75, 0.5 * 0.25))
    )
    wanted = between(moved, around, np.s_[:, 4:36, 2:66])
    assert np.abs(target[:, 3 + rows[:, None], 5 + columns[None]].astype(float) - wanted).max() <= 1
