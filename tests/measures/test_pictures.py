import numpy as np
import picture_measures  # type: ignore[import-not-found]
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from lipmotion.errors import InputError

HEIGHT, WIDTH = 56, 72


def blobs(seed: int, frames: int = 4, spread: float = 3.0):
    """Smooth pictures of all grey levels."""
    draw = np.random.default_rng(seed)
    values = gaussian_filter(draw.normal(size=(frames, HEIGHT, WIDTH, 3)), (0, spread, spread, 0))
    return np.clip(127 + values * 50 / values.std(), 0, 255).astype(np.uint8)


def ramp(slope: float = 2.0, frames: int = 4):
    """Pictures that brighten to the right."""
    return np.broadcast_to((slope * np.arange(WIDTH))[None, None, :, None], (frames, HEIGHT, WIDTH, 3)).copy()


def rectangle(margin: int = 16):
    region = np.zeros((HEIGHT, WIDTH), bool)
    region[margin:-margin, margin:-margin] = True
    return region


def test_each_frame_has_its_own_psnr():
    true = blobs(0).astype(float)
    made = true + np.array([1, 2, 4, 8])[:, None, None, None]
    assert picture_measures.psnr_db(made, true) == pytest.approx(20 * np.log10(255 / np.array([1, 2, 4, 8])))
    assert picture_measures.psnr_db(blobs(0), blobs(0)) == pytest.approx([100] * 4)


def test_similarity_is_that_of_scikit_image():
    """0.26: mean of structural_similarity(true, made, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
    data_range=255, channel_axis=2, full=True)[1], the map with the pixels near the edge, of float64 pictures."""
    true = blobs(1)
    made = np.clip(true + np.random.default_rng(2).normal(0, 8, true.shape), 0, 255).astype(np.uint8)
    wanted = [0.903145894, 0.913533544, 0.904709417, 0.918917066]
    assert picture_measures.structural_similarity(made, true) == pytest.approx(wanted, abs=1e-5)


@given(light=st.integers(1, 255), other=st.integers(1, 255))
@settings(max_examples=20)
def test_similarity_of_flat_pictures_is_that_of_their_light(light, other):
    made, true = (np.full((1, 20, 20, 3), level, np.uint8) for level in (light, other))
    stable = (0.01 * 255) ** 2
    expected = (2 * light * other + stable) / (light**2 + other**2 + stable)
    assert picture_measures.structural_similarity(made, true) == pytest.approx([expected], abs=1e-3)


def test_a_blurred_picture_is_less_similar_and_less_sharp():
    true = blobs(3, spread=1.0)
    made = gaussian_filter(true.astype(float), (0, 1, 1, 0))
    assert (picture_measures.structural_similarity(made, true) < 0.9).all()
    assert (picture_measures.sharpness(made) < 0.5 * picture_measures.sharpness(true)).all()
    assert picture_measures.picture_figures(made, true)["sharpness"] == pytest.approx(
        picture_measures.sharpness(made).mean() / picture_measures.sharpness(true).mean()
    )


def test_sharpness_of_a_ramp_is_the_square_of_its_slope():
    assert picture_measures.sharpness(ramp(3.0)) == pytest.approx([9] * 4)
    assert picture_measures.sharpness(ramp(3.0).swapaxes(1, 2)) == pytest.approx([9] * 4)


def test_contrast_is_the_deviation_of_the_brightness():
    halves = np.zeros((3, HEIGHT, WIDTH, 3))
    halves[:, :, WIDTH // 2 :] = (60, 90, 120)
    assert picture_measures.contrast(halves) == pytest.approx([45] * 3)
    assert picture_measures.contrast(halves[:, :, ::-1] + 50) == pytest.approx([45] * 3)
    assert picture_measures.picture_figures(halves / 2, halves)["contrast"] == pytest.approx(0.5)


def test_grey_pictures_have_no_colour_edges_and_red_ones_half():
    for colour, edges in (((1, 1, 1), 0), ((1, 0, 0), 9 / 2), ((0, 1, 0), 9)):
        assert picture_measures.colour_edges(ramp(3.0) * colour) == pytest.approx([edges] * 4)


def test_flicker_of_even_and_of_alternating_light():
    for slope, light, wanted in ((0, 5.0 * np.arange(6), 0), (1, np.array([0, 2, 0, 2, 0, 2]), 4)):
        assert picture_measures.flicker(ramp(slope, 6) + light[:, None, None, None]) == pytest.approx([wanted] * 4)


def test_a_step_at_the_outline_is_a_seam():
    region = rectangle()
    made = ramp(2.0) + 20.0 * region[None, ..., None]
    slopes, smooth = picture_measures.outline_slopes(made, region), picture_measures.outline_slopes(ramp(2.0), region)
    assert slopes.seam > 4
    assert slopes.inside == pytest.approx(smooth.inside)
    assert slopes.outside == pytest.approx(smooth.outside)
    ratio = float((slopes.at / smooth.at).mean())
    assert picture_measures.outline_figures(made, ramp(2.0), region)["seam_ratio"] == pytest.approx(ratio)


def test_a_step_of_a_vertical_edge_has_half_its_height_on_two_pixels():
    region = np.zeros((HEIGHT, WIDTH), bool)
    region[:, WIDTH // 2 :] = True
    slopes = picture_measures.outline_slopes(
        np.where(region[None, ..., None], 130.0, 100.0) * np.ones((2, 1, 1, 3)), region
    )
    assert slopes.at == pytest.approx([15, 15])
    assert slopes.inside == pytest.approx([0, 0], abs=1e-9)
    assert np.isnan(slopes.seam)


def test_beside_an_outline_a_redder_patch_has_an_offset_and_one_that_reddens_a_drift():
    region = rectangle()
    inside, outside = picture_measures.skin_beside(region)
    assert region[inside].all()
    assert not region[outside].any()
    assert inside[HEIGHT // 2, 16:24].tolist() == [False, False, True, True, True, True, False, False]
    assert outside[HEIGHT // 2, 8:16].tolist() == [False, False, True, True, True, True, False, False]
    true, steps = blobs(5, 6).astype(float), np.arange(6) - 2.5
    red = np.array([1.0, 0, 0]) * region[..., None]
    for made, offset, drift in (
        (true + 6 * red, 2, 0),
        (true + 3 * steps[:, None, None, None] * red, 0, 3 * steps.std() / np.sqrt(3)),
        (true - 10, 0, 0),  # a darker film is no change of colour
    ):
        found = picture_measures.colour_change(made, true, inside, outside)
        assert (found.offset, found.drift) == pytest.approx((offset, drift), abs=1e-4)


def test_equal_pictures_have_the_best_figures():
    true = blobs(7)
    figures = picture_measures.picture_figures(true, true)
    assert figures.pop("psnr_db") == pytest.approx(100)
    assert list(figures) == ["ssim", "sharpness", "contrast", "colour_edges", "flicker"]
    assert list(figures.values()) == pytest.approx([1] * 5)


def test_what_cannot_be_measured_is_refused():
    for wrong, message in (
        (lambda p: picture_measures.psnr_db(p, p[:, 1:]), "required"),
        (lambda p: picture_measures.structural_similarity(p[..., :2], p[..., :2]), "three colours"),
        (lambda p: picture_measures.sharpness(p[0]), "required"),
        (lambda p: picture_measures.sharpness(p[:0]), "at least one"),
        (lambda p: picture_measures.flicker(p[:2]), "at least 3"),
        (lambda p: picture_measures.outline_figures(p, p[1:], rectangle()), "required"),
        (lambda p: picture_measures.outline_slopes(p, np.ones((HEIGHT, WIDTH), bool)), "inside and outside"),
        (lambda p: picture_measures.outline_slopes(p, rectangle()[1:]), "of shape"),
        (lambda p: picture_measures.outline_slopes(p, rectangle(27)), "on either side"),
        (
            lambda p: picture_measures.colour_change(p, p, rectangle(), np.zeros((HEIGHT, WIDTH), bool)),
            "at least one pixel",
        ),
    ):
        with pytest.raises(InputError, match=message):
            wrong(blobs(0))
