import numpy as np
import pytest

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.types import Channel, Motion
from lipmotion_faces.appearance.motion_map import (
    COMPONENTS,
    FRAMES_PER_CENTRE,
    MOTION_MAP,
    OUTER_PERCENTAGE,
    MotionMap,
    channel_values,
    fit_motion_map,
    motion_map_arrays,
    motion_map_from_arrays,
)
from pipeline.damage import DAMAGES, UNREADABLE, damaged

CHANNELS = (Channel("opening"), Channel("width"), Channel("still"), Channel("weight", "weight"))
FRAMES = 3000


def poses(frames: int = FRAMES, seed: int = 0) -> np.ndarray:
    """Two channels that move alike, one that never does, and one of its own."""
    draw = np.random.default_rng(seed)
    opening, own = draw.uniform(0, 0.3, frames), draw.uniform(0, 1, frames)
    width = 0.6 - 0.4 * opening + draw.uniform(-0.02, 0.02, frames)
    return np.stack([opening, width, np.full(frames, 0.37), own], axis=1)


def pictured(values: np.ndarray) -> np.ndarray:
    """Teeth that two channels show together, a mouth that darkens ever faster, a line, and what nothing changes."""
    opening, own = values[:, 0] / 0.3, values[:, 3]
    return np.stack([opening * own, np.exp(2 * opening) / 4, 2 * opening - own, np.full(len(values), 7.0)], axis=1)


def motion(values: np.ndarray) -> Motion:
    return Motion(values, 25.0, CHANNELS)


@pytest.fixture(scope="module")
def fitted() -> MotionMap:
    return fit_motion_map(poses(), CHANNELS, pictured(poses()))


def test_a_known_function_is_found(fitted: MotionMap) -> None:
    unseen = poses(500, seed=1)
    predicted, wanted = fitted.predict(motion(unseen)), pictured(unseen)
    assert predicted.shape == (500, 4)
    assert np.abs(predicted - wanted).mean(axis=0) == pytest.approx([0, 0, 0, 0], abs=0.02)
    with_one = np.column_stack([np.ones(FRAMES), poses()])
    line = np.linalg.lstsq(with_one, pictured(poses()), rcond=None)[0]
    linear = np.column_stack([np.ones(500), unseen]) @ line
    errors = [np.square(values - wanted).mean(axis=0)[:2] for values in (predicted, linear)]
    assert (errors[0] < 0.1 * errors[1]).all()  # no lines


def test_a_channel_that_never_moves_is_left_out(fitted: MotionMap) -> None:
    assert fitted.names == ("opening", "width", "weight")
    assert fitted.basis.shape == (3, 3)
    other = poses(20, seed=2)
    moved = other.copy()
    moved[:, 2] = 5.0
    assert fitted.predict(motion(other)) == pytest.approx(fitted.predict(motion(moved)), abs=1e-6)


def test_components_have_unit_variance_and_are_as_many_as_move() -> None:
    draw = np.random.default_rng(3)
    for values, count in ((draw.normal(0, 1, (600, 6)) @ draw.normal(0, 0.1, (6, 50)), 6),
                          (draw.normal(0, 1, (900, 30)), COMPONENTS)):  # fmt: skip
        found = fit_motion_map(values, tuple(Channel(f"x_{n}") for n in range(values.shape[1])), values[:, :2])
        assert found.basis.shape == (values.shape[1], count)
        components = (values - found.mean) / found.scale @ found.basis
        assert np.cov(components.T) == pytest.approx(np.eye(count), abs=0.01)


def test_far_from_all_footage_it_is_as_at_its_edge(fitted: MotionMap) -> None:
    directions = poses(200, seed=4)[:, [0, 1, 3]] - fitted.mean
    wanted = pictured(poses())
    margin = 0.5 * np.ptp(wanted, axis=0) + 0.01
    for far in (1e5, -1e9):
        beyond, further = (np.insert(fitted.mean + directions * each, 2, 0.37, axis=1) for each in (far, 3 * far))
        predicted = fitted.predict(motion(beyond))
        assert np.isfinite(predicted).all()
        assert (predicted > wanted.min(axis=0) - margin).all()
        assert (predicted < wanted.max(axis=0) + margin).all()
        assert fitted.predict(motion(further)) == pytest.approx(predicted, abs=1e-4)


def test_limits_leave_out_the_outermost_poses() -> None:
    values = poses()
    values[17] = [40.0, -30.0, 0.37, 9.0]  # one frame in which the tracker was wrong
    found = fit_motion_map(values, CHANNELS, pictured(poses()))
    components = (values[:, [0, 1, 3]] - found.mean) / found.scale @ found.basis
    outside = (components < found.limits[0]) | (components > found.limits[1])
    assert outside[17].any()
    assert outside.mean(axis=0) == pytest.approx([2 * OUTER_PERCENTAGE / 100] * 3, abs=1e-3)


def test_short_footage_is_trusted_less(fitted: MotionMap) -> None:
    """What footage does not say is the mean picture: coefficients shrink as frames become few."""
    sizes = []
    for frames in (30, 300, FRAMES):
        values, wanted = poses(frames), pictured(poses(frames))
        found = fitted if frames == FRAMES else fit_motion_map(values, CHANNELS, wanted)
        sizes.append((found.predict(motion(values)).std(axis=0)[:3] / wanted.std(axis=0)[:3]).mean())
    assert sizes[0] < 0.6 < sizes[1] < sizes[2] < 1.01


def test_the_fewest_frames_give_about_the_mean() -> None:
    for frames in (FRAMES_PER_CENTRE, 10):
        values = poses(frames)
        found = fit_motion_map(values, CHANNELS, pictured(values))
        assert len(found.centres) == frames // FRAMES_PER_CENTRE
        assert found.predict(motion(values)).mean(axis=0) == pytest.approx(pictured(values).mean(axis=0), abs=0.05)


def test_motion_that_cannot_be_learned_from() -> None:
    broken = np.where(np.arange(20)[:, None] == 7, np.nan, poses(20))
    for values, targets in ((poses(2), np.zeros((2, 1))), (poses(20), np.zeros((19, 1))), (broken, np.zeros((20, 1)))):
        with pytest.raises(InputError, match="required finite motion of as many frames, at least 3"):
            fit_motion_map(values, CHANNELS, targets)


def test_motion_that_nobody_can_map(fitted: MotionMap) -> None:
    blendshapes = Motion(np.zeros((5, 2)), 25.0, (Channel("jawOpen", "weight"), Channel("opening")))
    with pytest.raises(InputError, match=r"no channel 'width' \(2 of the 3 that this face needs are missing\)"):
        fitted.predict(blendshapes)
    values = poses(5)
    values[3, 0] = np.inf
    with pytest.raises(InputError, match="not finite; give whole curves"):
        fitted.predict(motion(values))


def test_channels_are_found_by_name(fitted: MotionMap) -> None:
    values = poses(50, seed=5)
    order = [3, 1, 2, 0]
    turned = Motion(values[:, order], 25.0, tuple(CHANNELS[n] for n in order))
    assert channel_values(turned, ("opening", "width")) == pytest.approx(values[:, :2])
    assert fitted.predict(turned) == pytest.approx(fitted.predict(motion(values)))


def test_as_arrays_and_back_and_damaged_arrays(fitted: MotionMap) -> None:
    arrays, values = motion_map_arrays(fitted), motion(poses(50, seed=6))
    again = motion_map_from_arrays(arrays, 4)
    assert (again.names, np.array_equal(again.predict(values), fitted.predict(values))) == (fitted.names, True)
    assert arrays.keys() == MOTION_MAP.keys()
    for name in arrays:
        with pytest.raises(ModelFormatError, match=f"{name} is missing.*build the face again"):
            motion_map_from_arrays({key: value for key, value in arrays.items() if key != name}, 4)
    broken = list(damaged(arrays, {damage: DAMAGES[damage] for damage in UNREADABLE}))
    assert len(broken) >= 6 * 6
    for _name, _what, changed in broken:
        with pytest.raises(ModelFormatError, match="the map from motion to pictures is damaged"):
            motion_map_from_arrays(changed, 4)
    for change, targets, words in (
        ({"scale": np.zeros(3)}, 4, "scale holds 0 to 0, required more than 0"),
        ({"names": np.array(["opening", "width", "width"])}, 4, "channels twice, or limits the wrong way round"),
        ({"limits": np.array([[1.0] * 3, [-1.0] * 3])}, 4, "channels twice, or limits the wrong way round"),
        ({"coefficients": np.zeros((5, 4), np.float32)}, 4, "5 coefficients, required 404"),
        ({}, 5, "coefficients of shape"),
    ):
        with pytest.raises(ModelFormatError, match=words):
            motion_map_from_arrays(arrays | change, targets)
