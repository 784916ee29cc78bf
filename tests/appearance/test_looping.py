from itertools import pairwise

import numpy as np
import pytest

from appearance.test_candidates import pictures
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.storage.archive import read_archive, write_archive
from lipmotion_faces.appearance import camera_noise, looping

RATE_HZ = 25.0
FADE_FRAMES = looping.count_fade(RATE_HZ)


def background(path, blinks=(), noise: float = 0.02) -> looping.FrameDescriptors:
    """A head whose position is a path [shape=(T,)], and that blinks at some frames."""
    count = len(path)
    draw = np.random.default_rng(2)
    patterns = draw.normal(size=(2, 40))
    position = np.asarray(path, float)[:, None]
    rows = np.sin(position + patterns[0]) * 5 + noise * draw.normal(size=(count, 40))
    eyes = 50 + 0.3 * draw.normal(size=(count, 20))
    for blink in blinks:
        eyes[blink - 1 : blink + 3] += np.array([10, 25, 20, 8])[: max(0, count - blink + 1), None]
    return looping.FrameDescriptors(rows, rows + 1, eyes, np.repeat(position, 6, axis=1))


def wander(count: int, seed: int = 0) -> np.ndarray:
    """A path that does not repeat."""
    steps = np.convolve(np.random.default_rng(seed).normal(size=count + 20), np.ones(12) / 12, "same")[10 : 10 + count]
    return np.cumsum(steps * 0.3) + np.arange(count) * 0.05


def displayed(order: looping.LoopOrder, rows) -> np.ndarray:
    return (1 - order.weight[:, None]) * rows[order.first] + order.weight[:, None] * rows[order.second]


def test_a_long_background_is_shown_as_it_is():
    for count in (1, 30, 75):
        order = looping.find_loop_order(background(wander(75)), count, RATE_HZ)
        assert len(order) == count
        assert order.joins == ()
        np.testing.assert_array_equal(np.diff(order.first), 1)
        assert not order.weight.any()


def test_a_short_one_goes_to_and_fro():
    descriptors = background(wander(75))
    for count, seed in ((76, 0), (200, 1), (2000, 2)):
        order = looping.find_loop_order(descriptors, count, RATE_HZ, seed=seed)
        assert len(order) == count
        assert order.first.min() >= 0
        assert max(order.first.max(), order.second.max()) < 75
        steps = np.diff(order.first)
        jumps = {join.at for join in order.joins if join.kind == "jump"}
        for at in np.flatnonzero(np.abs(steps) != 1) + 1:
            assert any(abs(at - jump) <= FADE_FRAMES for jump in jumps)


def test_no_step_is_much_larger_than_usual():
    descriptors = background(wander(150))
    rows = descriptors.standardise([(0, 150)])
    usual = np.linalg.norm(np.diff(rows, axis=0), axis=1)
    order = looping.find_loop_order(descriptors, 3000, RATE_HZ)
    shown = np.linalg.norm(np.diff(displayed(order, rows), axis=0), axis=1)
    assert shown.max() <= 1.1 * max(usual.max(), looping.JUMP_LIMIT)
    turns = [join.cost for join in order.joins if join.kind == "turn"]
    assert max(turns) < 1.5  # of the median speed


def test_a_motion_that_repeats_is_looped_forwards():
    path = 3 * np.sin(2 * np.pi * np.arange(130) / 50)
    descriptors = background(path)
    order = looping.find_loop_order(descriptors, 1500, RATE_HZ)
    jumps = [join for join in order.joins if join.kind == "jump"]
    assert len(jumps) >= 3
    for jump in jumps:
        assert jump.cost < looping.JUMP_LIMIT
    rows = descriptors.standardise([(0, 130)])
    shown = np.linalg.norm(np.diff(displayed(order, rows), axis=0), axis=1)
    assert shown.max() < looping.JUMP_LIMIT + np.linalg.norm(np.diff(rows, axis=0), axis=1).max()


def test_jumps_go_on_in_the_same_direction():
    path = np.abs(np.arange(240) % 80 - 40) * 0.2  # to and fro: the same places, in both directions
    order = looping.find_loop_order(background(path), 2000, RATE_HZ)
    jumps = [join.at for join in order.joins if join.kind == "jump"]
    assert len(jumps) > 9
    for at in jumps:
        old, new = order.first[at - FADE_FRAMES], order.first[min(at + FADE_FRAMES, 1999)]
        way = 1 if old > order.first[at - FADE_FRAMES - 1] else -1
        is_near_turn = min(old % 40, 40 - old % 40) <= 2 * FADE_FRAMES  # of the path itself
        assert np.sign(path[old] - path[old - way]) == np.sign(path[new] - path[new - way]) or is_near_turn


def test_no_join_in_a_blink_or_near_one():
    again_and_again = np.abs(np.arange(150) % 50) * 0.2
    for path, blinks in ((wander(150), (30, 75, 120)), (again_and_again, (20, 50, 80, 110, 140))):
        order = looping.find_loop_order(background(path, blinks), 3000, RATE_HZ)
        assert len(order.joins) > 20
        for last in [*(order.first[join.at - 1] for join in order.joins), order.first[-1]]:
            assert min(abs(last - blink - 0.5) for blink in blinks) > 2.5 + looping.BUSY_S * RATE_HZ


def test_what_was_not_shown_comes_first():
    """Four scenes of one head: ten seconds show more than half of them, and scenes follow one another by jumps."""
    path = np.tile(wander(75), 4)
    order = looping.find_loop_order(background(path), 1500, RATE_HZ, cuts=(75, 150, 225))
    fresh = [len(set(order.first[n : n + 250].tolist())) / 250 for n in range(0, 1250, 25)]
    assert np.mean(fresh) > 0.6
    assert sum(join.kind == "jump" for join in order.joins) > sum(join.kind == "turn" for join in order.joins)


def test_the_seed_alone_decides():
    descriptors = background(wander(100))
    orders = [looping.find_loop_order(descriptors, 1000, RATE_HZ, seed=seed).first for seed in (4, 4, 5)]
    np.testing.assert_array_equal(orders[0], orders[1])
    assert (orders[0] != orders[2]).any()


def test_only_frames_that_may_be_shown():
    usable = np.ones(120, bool)
    usable[[0, 1, 50, 51, 119]] = False
    order = looping.find_loop_order(background(wander(120)), 2000, RATE_HZ, usable=usable, cuts=(90,))
    assert usable[order.first].all()
    assert usable[order.second].all()
    crossings = [(a, b) for a, b in pairwise(order.first.tolist()) if (a < 90) != (b < 90)]
    jumps = {join.at for join in order.joins if join.kind == "jump"}
    assert len(crossings) <= len(jumps)


def test_nothing_to_show_is_refused():
    for count, usable in ((0, None), (5, np.zeros(50, bool)), (5, np.ones(49, bool))):
        with pytest.raises(InputError, match="required at least one of each"):
            looping.find_loop_order(background(wander(50)), count, RATE_HZ, usable=usable)


def test_tiny_and_still_backgrounds():
    for length in (1, 2, 3, 5, 21):
        order = looping.find_loop_order(background(wander(length)), 100, RATE_HZ)
        assert len(order) == 100
        assert set(order.first.tolist()) <= set(range(length))
        assert np.abs(np.diff(order.first)).max() <= 1
    assert len(looping.find_loop_order(background(np.zeros(60), noise=0.0), 500, RATE_HZ)) == 500


MAP = np.array([[0.7, 0, 80.0], [0, 0.7, 60.0]])


def scene(count: int = 4) -> np.ndarray:
    """One smooth picture, again and again [shape=(T, 144, 160, 3)]."""
    y, x = np.mgrid[:144, :160]
    picture = 120 + 50 * np.sin(x / 11) * np.cos(y / 13) + x / 8
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[None, :, :, None], count, axis=0).repeat(3, axis=3)


def maps(moves) -> np.ndarray:
    result = np.repeat(MAP[None], len(moves), axis=0)
    result[:, :, 2] += moves
    return result


def distances_of(frames: np.ndarray, moves=None) -> np.ndarray:
    """Distances between frames whose face moves, or not."""
    count = len(frames)
    descriptors = looping.describe_frames(frames, maps(np.zeros((count, 2)) if moves is None else moves))
    assert len(descriptors) == count
    return looping.compare_rows(descriptors.standardise([(0, count)]))


def test_equal_frames_have_no_distance_and_the_mouth_does_not_count():
    frames = scene()
    assert distances_of(frames).max() < 1e-5
    frames[2, 95:130, 60:100] = 0  # below the nose
    assert distances_of(frames)[2].max() < 1e-5
    frames[2, 50:66, 50:110] = 0  # the eyes
    assert distances_of(frames)[2, 0] > 0.5
    for size in ((20, 30), (1, 1)):
        assert np.isfinite(distances_of(np.zeros((2, *size, 3), np.uint8))).all()


def test_the_aligned_face_does_not_move():
    still = scene(3)
    moved = np.stack([np.roll(frame, (3 * n, 4 * n), axis=(0, 1)) for n, frame in enumerate(still)])
    descriptors = looping.describe_frames(moved, maps([(4 * n, 3 * n) for n in range(3)]))
    change = np.abs(np.diff(descriptors.eyes, axis=0)).mean()
    unaligned = looping.describe_frames(moved, maps(np.zeros((3, 2))))
    assert change < 0.3 * np.abs(np.diff(unaligned.eyes, axis=0)).mean()
    np.testing.assert_allclose(np.diff(descriptors.place, axis=0), np.tile([4, 4, 4, 3, 3, 3], (2, 1)))


def test_other_frames_than_maps_are_refused():
    for frames in (scene(3), scene(5), [], [scene(1)[0], *scene(3)[:, :100]]):
        with pytest.raises(InputError, match="required as many"):
            looping.describe_frames(frames, maps(np.zeros((4, 2))))


SIZE = (40, 50)
COVARIANCE = np.array([[9.0, 3.0, 2.0], [3.0, 4.0, 1.0], [2.0, 1.0, 6.0]])


def still(count: int, noise: camera_noise.CameraNoise, seed: int = 0) -> np.ndarray:
    """A picture that does not move, with noise."""
    return camera_noise.NoiseSource(noise, SIZE, seed).add(np.full((count, *SIZE, 3), 120, np.uint8))


def test_what_was_added_is_found_again() -> None:
    for spread in ((0.0, 0.0), (0.7, 1.0)):
        found = camera_noise.estimate_noise(
            [still(200, camera_noise.CameraNoise(COVARIANCE, np.array(spread)), seed) for seed in range(4)]
        )
        assert found.covariance == pytest.approx(COVARIANCE, abs=0.8)
        assert found.spread_px == pytest.approx(spread, abs=0.2)


def test_noise_is_measured_where_nothing_moves() -> None:
    noise = camera_noise.CameraNoise(COVARIANCE, np.zeros(2))
    clip = still(100, noise).astype(int)
    clip[40:] += np.random.default_rng(0).integers(-60, 60, (60, 1, 1, 1))
    found = camera_noise.estimate_noise([np.clip(clip, 0, 255).astype(np.uint8)])
    assert np.diag(found.covariance) == pytest.approx(np.diag(COVARIANCE), rel=0.3)


def test_the_noise_of_a_frame_depends_on_seed_and_number_alone() -> None:
    noise, images = camera_noise.CameraNoise(COVARIANCE, np.array([0.8, 0.8])), np.full((12, *SIZE, 3), 120, np.uint8)
    whole = camera_noise.NoiseSource(noise, SIZE, 5).add(images)
    again = camera_noise.NoiseSource(noise, SIZE, 5)
    assert np.array_equal(np.concatenate([again.add(images[:5]), again.add(images[5:], 5)]), whole)
    assert not np.array_equal(camera_noise.NoiseSource(noise, SIZE, 6).add(images), whole)
    assert not np.array_equal(whole[0], whole[1])


def test_what_are_no_pictures() -> None:
    for clips in ([], [pictures(0, 2), pictures(1, 1)]):
        with pytest.raises(InputError, match="no clip of at least three pictures"):
            camera_noise.estimate_noise(clips)
    with pytest.raises(InputError, match=r"required \(T, H, W, 3\), uint8"):
        camera_noise.estimate_noise([pictures().astype(float)])
    with pytest.raises(InputError, match=r"required \(T, 40, 50, 3\), uint8"):
        camera_noise.NoiseSource(camera_noise.CameraNoise(COVARIANCE, np.zeros(2)), SIZE, 0).add(pictures())


def test_noise_through_a_file_and_hostile_files(tmp_path) -> None:
    noise = camera_noise.CameraNoise(COVARIANCE, np.array([0.8, 0.0]))
    write_archive(tmp_path / "n", {}, camera_noise.camera_noise_to_arrays(noise))
    again = camera_noise.camera_noise_from_arrays(read_archive(tmp_path / "n"))
    assert np.array_equal(still(3, again), still(3, noise))
    for changes, says in (
        ({"noise_covariance": -np.eye(3)}, "no covariance matrix"),
        ({"noise_covariance": np.triu(COVARIANCE)}, "no covariance matrix"),
        ({"noise_covariance": 1e9 * np.eye(3)}, "required -65025 to 65025"),
        ({"noise_spread_px": np.array([0.5, 1e6])}, "required 0 to 3"),
    ):
        with pytest.raises(ModelFormatError, match=f"{says}.*build it again"):
            camera_noise.camera_noise_from_arrays(camera_noise.camera_noise_to_arrays(noise) | changes)
