import numpy as np
import pytest

from appearance.test_eigenlips import pictures
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.storage.archive import read_archive, write_archive
from lipmotion_faces.appearance.camera_noise import (
    CameraNoise,
    NoiseSource,
    camera_noise_arrays,
    camera_noise_from_arrays,
    estimate_noise,
)

SIZE = (40, 50)
COVARIANCE = np.array([[9.0, 3.0, 2.0], [3.0, 4.0, 1.0], [2.0, 1.0, 6.0]])


def still(count: int, noise: CameraNoise, seed: int = 0) -> np.ndarray:
    """A picture that does not move, with noise."""
    return NoiseSource(noise, SIZE, seed).add(np.full((count, *SIZE, 3), 120, np.uint8))


def test_what_was_added_is_found_again() -> None:
    for spread in ((0.0, 0.0), (0.7, 1.0)):
        found = estimate_noise([still(200, CameraNoise(COVARIANCE, np.array(spread)), seed) for seed in range(4)])
        assert found.covariance == pytest.approx(COVARIANCE, abs=0.8)
        assert found.spread_px == pytest.approx(spread, abs=0.2)


def test_noise_is_measured_where_nothing_moves() -> None:
    noise = CameraNoise(COVARIANCE, np.zeros(2))
    clip = still(100, noise).astype(int)
    clip[40:] += np.random.default_rng(0).integers(-60, 60, (60, 1, 1, 1))
    found = estimate_noise([np.clip(clip, 0, 255).astype(np.uint8)])
    assert np.diag(found.covariance) == pytest.approx(np.diag(COVARIANCE), rel=0.3)


def test_pictures_without_noise_have_none() -> None:
    found = estimate_noise([np.repeat(pictures(0, 1), 9, axis=0)])
    assert np.diag(found.covariance) == pytest.approx([0, 0, 0], abs=1e-12)
    images = pictures(1, 5)
    assert np.array_equal(NoiseSource(found, (9, 12), 0).add(images), images)


def test_the_noise_of_a_frame_depends_on_seed_and_number_alone() -> None:
    noise, images = CameraNoise(COVARIANCE, np.array([0.8, 0.8])), np.full((12, *SIZE, 3), 120, np.uint8)
    whole = NoiseSource(noise, SIZE, 5).add(images)
    again = NoiseSource(noise, SIZE, 5)
    assert np.array_equal(np.concatenate([again.add(images[:5]), again.add(images[5:], 5)]), whole)
    assert not np.array_equal(NoiseSource(noise, SIZE, 6).add(images), whole)
    assert not np.array_equal(whole[0], whole[1])


def test_noise_stays_within_black_and_white() -> None:
    strong = CameraNoise(1000 * np.eye(3), np.zeros(2))
    dark = NoiseSource(strong, SIZE, 0).add(np.zeros((3, *SIZE, 3), np.uint8))
    assert dark.max() < 200
    assert 0.4 < (dark == 0).mean() < 0.6


def test_what_are_no_pictures() -> None:
    for clips in ([], [pictures(0, 2), pictures(1, 1)]):
        with pytest.raises(InputError, match="no clip of at least three pictures"):
            estimate_noise(clips)
    with pytest.raises(InputError, match=r"required \(T, H, W, 3\), uint8"):
        estimate_noise([pictures().astype(float)])
    with pytest.raises(InputError, match=r"required \(T, 40, 50, 3\), uint8"):
        NoiseSource(CameraNoise(COVARIANCE, np.zeros(2)), SIZE, 0).add(pictures())


def test_noise_through_a_file_and_hostile_files(tmp_path) -> None:
    noise = CameraNoise(COVARIANCE, np.array([0.8, 0.0]))
    write_archive(tmp_path / "n", {}, camera_noise_arrays(noise))
    again = camera_noise_from_arrays(read_archive(tmp_path / "n"))
    assert np.array_equal(still(3, again), still(3, noise))
    for changes, says in (
        ({"noise_covariance": -np.eye(3)}, "no covariance matrix"),
        ({"noise_covariance": np.triu(COVARIANCE)}, "no covariance matrix"),
        ({"noise_covariance": 1e9 * np.eye(3)}, "required -65025 to 65025"),
        ({"noise_spread_px": np.array([0.5, 1e6])}, "required 0 to 3"),
    ):
        with pytest.raises(ModelFormatError, match=f"{says}.*build it again"):
            camera_noise_from_arrays(camera_noise_arrays(noise) | changes)
