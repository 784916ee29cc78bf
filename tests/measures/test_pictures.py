import numpy as np
import picture_measures  # type: ignore[import-not-found]
import pytest
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


def test_figures_by_hand():
    true = blobs(0).astype(float)
    made = true + np.array([1, 2, 4, 8])[:, None, None, None]
    assert picture_measures.psnr_db(made, true) == pytest.approx(20 * np.log10(255 / np.array([1, 2, 4, 8])))
    assert picture_measures.sharpness(ramp(3.0)) == pytest.approx([9] * 4)
    halves = np.zeros((3, HEIGHT, WIDTH, 3))
    halves[:, :, WIDTH // 2 :] = (60, 90, 120)
    assert picture_measures.contrast(halves) == pytest.approx([45] * 3)
    for colour, edges in (((1, 1, 1), 0), ((1, 0, 0), 9 / 2), ((0, 1, 0), 9)):
        assert picture_measures.colour_edges(ramp(3.0) * colour) == pytest.approx([edges] * 4)
    light = np.array([0, 2, 0, 2, 0, 2])[:, None, None, None]
    assert picture_measures.flicker(ramp(1, 6) + light) == pytest.approx([4] * 4)
    figures = picture_measures.picture_figures(true, true)
    assert (figures.pop("psnr_db"), *figures.values()) == pytest.approx((100, *[1] * 5))
    with pytest.raises(InputError, match="required"):
        picture_measures.psnr_db(made, true[:, 1:])


def test_similarity_is_that_of_scikit_image():
    """0.26: mean of structural_similarity(true, made, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
    data_range=255, channel_axis=2, full=True)[1], the map with the pixels near the edge, of float64 pictures."""
    true = blobs(1)
    made = np.clip(true + np.random.default_rng(2).normal(0, 8, true.shape), 0, 255).astype(np.uint8)
    wanted = [0.903145894, 0.913533544, 0.904709417, 0.918917066]
    assert picture_measures.structural_similarity(made, true) == pytest.approx(wanted, abs=1e-5)


def test_a_step_at_the_outline_is_a_seam():
    region = rectangle()
    made = ramp(2.0) + 20.0 * region[None, ..., None]
    slopes, smooth = picture_measures.outline_slopes(made, region), picture_measures.outline_slopes(ramp(2.0), region)
    assert slopes.seam > 4
    assert slopes.inside == pytest.approx(smooth.inside)
    assert slopes.outside == pytest.approx(smooth.outside)
    ratio = float((slopes.at / smooth.at).mean())
    assert picture_measures.outline_figures(made, ramp(2.0), region)["seam_ratio"] == pytest.approx(ratio)


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
