from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lipmotion import FilmedFace, types
from lipmotion.errors import InputError, ModelFormatError
from lipmotion_faces.appearance import candidates, lower_face, motion_map
from lipmotion_faces.appearance.person import JAW_CANDIDATES, Appearance, FootagePictures, learn_appearance
from pipeline.damage import DAMAGES, UNREADABLE, damaged
from testing.toy import toy_motion, toy_sentences
from testing.toy_face import NOISE, SHAPE, toy_chin_px, toy_footage_pictures, toy_lower_faces

MOUTH = (slice(None), *lower_face.find_mouth_part(1))


@pytest.fixture(scope="module")
def appearance(filmed_face: FilmedFace) -> Appearance:
    return filmed_face.appearance


@pytest.fixture(scope="module")
def distances(appearance: Appearance) -> np.ndarray:
    """Opening, width and outer lips of the candidates."""
    assert appearance.mouth_distances is not None
    return appearance.mouth_distances


@pytest.fixture(scope="module")
def footage() -> FootagePictures:
    return toy_footage_pictures()


@pytest.fixture(scope="module")
def unseen() -> types.Motion:
    """Of a sentence that the appearance was not learned from."""
    return toy_motion(toy_sentences(8)[6].units, 25.0)


def test_its_parts(appearance: Appearance, footage: FootagePictures) -> None:
    count = len(footage.motion)
    assert (appearance.shape, appearance.scale) == (SHAPE, 1)
    assert appearance.mouth_codes.shape == (len(appearance.mouths), 90)
    assert 200 < len(appearance.mouths) <= min(candidates.CANDIDATES, count)
    assert appearance.jaw_codes.shape == (len(appearance.jaws), 36)
    assert len(appearance.jaws) == JAW_CANDIDATES
    assert appearance.from_motion.names == ("opening", "width", "outer")
    assert (appearance.mouth.explained > 0.98).all()
    assert np.sqrt(np.diag(appearance.noise.covariance)) == pytest.approx([NOISE] * 3, rel=0.05)
    light = np.median(lower_face.measure_cheek_light(np.concatenate(footage.clips)[MOUTH]), axis=0)
    assert appearance.light == pytest.approx(light)


def test_damaged_pictures_are_no_candidates(footage: FootagePictures) -> None:
    """Each has a black spot, all of them elsewhere: eigenlips can learn few of these."""
    pictures, (rows, columns) = np.concatenate(footage.clips), lower_face.find_mouth_part(1)
    for number in range(140):
        pictures[number, rows.start + 1 + number % 6, columns.start + 1 + number // 6] = 0
    found = learn_appearance(replace(footage, clips=(pictures,))).mouths
    spotted = (found[:, 1:7, 1:25] < 60).any(axis=(1, 2, 3))
    assert spotted.mean() < 0.15


def test_motion_becomes_the_mouth_that_was_drawn(appearance: Appearance, unseen: types.Motion) -> None:
    codes, drawn = appearance.predict_codes(unseen), toy_lower_faces(unseen, noise=0)[MOUTH].astype(float)
    shown = appearance.mouth.restore(codes.mouth).astype(float)
    assert np.square(shown - drawn).mean() < 0.4 * np.square(drawn.mean(axis=0) - drawn).mean()
    every = np.stack([codes.mouth, appearance.mouth.project(drawn.astype(np.uint8))])
    fine = every.reshape(2, len(drawn), 3, -1)[..., 4:].std(axis=1).mean(axis=(1, 2))
    assert 0.7 < fine[0] / fine[1] < 1.1  # those of mixtures alone vary half as much
    dark = [(mouths < 90).all(axis=3).sum(axis=(1, 2)) for mouths in (shown, drawn)]
    assert np.corrcoef(dark)[0, 1] > 0.95  # the mouth opens when it should
    assert codes.chin_px == pytest.approx(toy_chin_px(unseen), abs=1.5)


def test_mouths_are_as_wide_as_the_motion(appearance: Appearance, distances: np.ndarray, unseen: types.Motion) -> None:
    """A regression alone draws them to the mean; a person's own recorded mouths are the limit."""
    order = distances[:, 1].argsort()
    narrow, wide = (appearance.mouth_codes[ends] for ends in (order[:20], order[-20:]))
    for width, near, far in ((np.percentile(distances[:, 1], 5), narrow, wide), (9.0, wide, narrow)):
        values = unseen.values.copy()
        values[:, unseen.column("width")] = width
        shown = appearance.predict_codes(types.Motion(values, 25.0, unseen.channels)).mouth
        likeness = [np.linalg.norm(shown[:, None] - each, axis=2).min(axis=1).mean() for each in (near, far)]
        assert likeness[0] < likeness[1]


def test_a_closure_shows_a_recorded_mouth_that_is_closed(
    appearance: Appearance, distances: np.ndarray, unseen: types.Motion
) -> None:
    contact = np.zeros(len(unseen.values))
    contact[[9, 13]], contact[10:13] = 0.5, 1.0
    values = unseen.values.copy()
    values[10:13, unseen.column("opening")] = 0.0
    motion = types.Motion(values, 25.0, unseen.channels)
    mixed, closed = appearance.predict_codes(motion).mouth, appearance.predict_codes(motion, contact).mouth
    apart = np.linalg.norm(appearance.mouth_codes - closed[11], axis=1)
    assert apart.min() < 1e-3 * np.linalg.norm(closed[11])
    assert distances[apart.argmin(), 0] < 0.01
    assert closed[10:12] == pytest.approx(closed[11:13], abs=1e-3)
    assert closed[9] == pytest.approx((mixed[9] + closed[11]) / 2, abs=1e-2)
    assert np.array_equal(closed[14:], mixed[14:])
    pause = appearance.predict_codes(motion, np.ones(len(values))).mouth  # too long for a closure
    assert np.array_equal(pause, mixed)


def test_a_jaw_of_sound_is_the_least_squares_line_of_its_level(
    appearance: Appearance, footage: FootagePictures, unseen: types.Motion
) -> None:
    codes = appearance.predict_codes(unseen)
    levels = (np.full(len(codes), level) for level in (-60, -40, -20))
    quiet, middle, loud = (appearance.with_jaw_of_sound(codes, level) for level in levels)
    assert np.array_equal(loud.mouth, codes.mouth)
    assert quiet.chin_px[0] + 1 < middle.chin_px[0] < loud.chin_px[0] - 1
    assert middle.chin_px == pytest.approx((quiet.chin_px + loud.chin_px) / 2, abs=1e-3)
    assert middle.jaw == pytest.approx((quiet.jaw + loud.jaw) / 2, abs=1e-2)
    slope, start = np.polyfit(footage.levels_db, footage.chin_px, 1)
    assert appearance.from_sound[:, -1] == pytest.approx([start, slope], rel=0.01)


@pytest.mark.parametrize(
    ("wrong", "counts"),
    [("motion", "266 pictures, 265 .*266 of"), ("levels_db", "266 pictures, 266 .*265 of"), ("clips", "0 pictures")],
)
def test_footage_that_does_not_fit_together(footage: FootagePictures, wrong: str, counts: str) -> None:
    part: Any = () if wrong == "clips" else getattr(footage, wrong)[:-1]
    with pytest.raises(InputError, match=counts):
        learn_appearance(replace(footage, **{wrong: part}))


CHANNELS = (types.Channel("opening"), types.Channel("width"), types.Channel("still"), types.Channel("weight", "weight"))
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


def motion(values: np.ndarray) -> types.Motion:
    return types.Motion(values, 25.0, CHANNELS)


@pytest.fixture(scope="module")
def fitted() -> motion_map.MotionMap:
    return motion_map.fit_motion_map(poses(), CHANNELS, pictured(poses()))


def test_a_known_function_is_found(fitted: motion_map.MotionMap) -> None:
    unseen = poses(500, seed=1)
    predicted, wanted = fitted.predict(motion(unseen)), pictured(unseen)
    assert predicted.shape == (500, 4)
    assert np.abs(predicted - wanted).mean(axis=0) == pytest.approx([0, 0, 0, 0], abs=0.02)
    with_one = np.column_stack([np.ones(FRAMES), poses()])
    line = np.linalg.lstsq(with_one, pictured(poses()), rcond=None)[0]
    linear = np.column_stack([np.ones(500), unseen]) @ line
    errors = [np.square(values - wanted).mean(axis=0)[:2] for values in (predicted, linear)]
    assert (errors[0] < 0.1 * errors[1]).all()  # no lines


def test_a_channel_that_never_moves_is_left_out(fitted: motion_map.MotionMap) -> None:
    assert fitted.names == ("opening", "width", "weight")
    assert fitted.basis.shape == (3, 3)
    other = poses(20, seed=2)
    moved = other.copy()
    moved[:, 2] = 5.0
    assert fitted.predict(motion(other)) == pytest.approx(fitted.predict(motion(moved)), abs=1e-6)


def test_far_from_all_footage_it_is_as_at_its_edge(fitted: motion_map.MotionMap) -> None:
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


def test_motion_that_cannot_be_learned_from() -> None:
    broken = np.where(np.arange(20)[:, None] == 7, np.nan, poses(20))
    for values, targets in ((poses(2), np.zeros((2, 1))), (poses(20), np.zeros((19, 1))), (broken, np.zeros((20, 1)))):
        with pytest.raises(InputError, match="required finite motion of as many frames, at least 3"):
            motion_map.fit_motion_map(values, CHANNELS, targets)


def test_motion_that_nobody_can_map(fitted: motion_map.MotionMap) -> None:
    blendshapes = types.Motion(np.zeros((5, 2)), 25.0, (types.Channel("jawOpen", "weight"), types.Channel("opening")))
    with pytest.raises(InputError, match=r"no channel 'width' \(2 of the 3 that this face needs are missing\)"):
        fitted.predict(blendshapes)
    values = poses(5)
    values[3, 0] = np.inf
    with pytest.raises(InputError, match="not finite; give whole curves"):
        fitted.predict(motion(values))


def test_as_arrays_and_back_and_damaged_arrays(fitted: motion_map.MotionMap) -> None:
    arrays, values = motion_map.motion_map_to_arrays(fitted), motion(poses(50, seed=6))
    again = motion_map.motion_map_from_arrays(arrays, 4)
    assert (again.names, np.array_equal(again.predict(values), fitted.predict(values))) == (fitted.names, True)
    assert arrays.keys() == motion_map.MOTION_MAP.keys()
    for name in arrays:
        with pytest.raises(ModelFormatError, match=f"{name} is missing.*build the face again"):
            motion_map.motion_map_from_arrays({key: value for key, value in arrays.items() if key != name}, 4)
    broken = list(damaged(arrays, {damage: DAMAGES[damage] for damage in UNREADABLE}))
    assert len(broken) >= 6 * 6
    for _name, _what, changed in broken:
        with pytest.raises(ModelFormatError, match="the map from motion to pictures is damaged"):
            motion_map.motion_map_from_arrays(changed, 4)
    for change, targets, words in (
        ({"scale": np.zeros(3)}, 4, "scale holds 0 to 0, required more than 0"),
        ({"names": np.array(["opening", "width", "width"])}, 4, "channels twice, or limits the wrong way round"),
        ({"limits": np.array([[1.0] * 3, [-1.0] * 3])}, 4, "channels twice, or limits the wrong way round"),
        ({"coefficients": np.zeros((5, 4), np.float32)}, 4, "5 coefficients, required 404"),
        ({}, 5, "coefficients of shape"),
    ):
        with pytest.raises(ModelFormatError, match=words):
            motion_map.motion_map_from_arrays(arrays | change, targets)


CHIN_PX = 118.0


def with_line(chin_px: float = CHIN_PX, scale: int = 1, count: int = 1) -> np.ndarray:
    """Lower faces of one colour, with a soft dark line at the tip of the chin."""
    y = (np.arange(lower_face.HEIGHT * scale) + 0.5) / scale + lower_face.CORNER[1]
    levels = np.rint(180 - 120 * np.exp(-(((y - chin_px) / 1.5) ** 2))).astype(np.uint8)
    return np.tile(levels[:, None, None], (count, 1, lower_face.WIDTH * scale, 3))


def line_px(picture: np.ndarray, x: float = 0.0) -> float:
    """Return how far the line is below the eyes in one column, to a fraction of a pixel."""
    scale = picture.shape[0] // lower_face.HEIGHT
    column = round((x - lower_face.CORNER[0]) * scale - 0.5)
    darkness = 180.0 - picture[:, column, 0]
    y = (np.arange(len(picture)) + 0.5) / scale + lower_face.CORNER[1]
    return float((y * darkness).sum() / darkness.sum())


def test_the_tip_moves_as_far_as_it_should() -> None:
    drops = np.array([-9.0, -0.4, 0.0, 0.3, 6.7, 12.0])
    for scale in (1, 2):
        pictures = with_line(scale=scale, count=len(drops))
        moved = lower_face.move_chin(pictures, np.full(len(drops), CHIN_PX), drops)
        assert moved.dtype == np.uint8
        assert [line_px(picture) - line_px(pictures[0]) for picture in moved] == pytest.approx(drops, abs=0.15)
    chins = np.array([112.0, 125.0])  # elsewhere in every frame
    moved = lower_face.move_chin(np.concatenate([with_line(chin) for chin in chins]), chins, np.full(2, 5.0))
    assert [line_px(picture) for picture in moved] == pytest.approx(chins + 5, abs=0.3)
    chins, limits = np.full(2, CHIN_PX), np.array([1.0, -1.0]) * lower_face.LARGEST_PX  # no further than a neck allows
    moved, limit = (lower_face.move_chin(with_line(count=2), chins, drops) for drops in (3 * limits, limits))
    assert np.array_equal(moved, limit)


def test_what_does_not_move_stays_to_the_bit() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (2, lower_face.HEIGHT, lower_face.WIDTH, 3), np.uint8)
    before = noise.copy()
    still = lower_face.move_chin(noise, np.full(2, CHIN_PX), np.array([0.0, 0.9 * lower_face.MIN_PX]))
    assert np.array_equal(still, before)
    moved = lower_face.move_chin(noise, np.full(2, CHIN_PX), np.array([8.0, -8.0]))
    assert np.array_equal(noise, before)  # the given pictures are not changed
    y = np.arange(lower_face.HEIGHT) + 0.5 + lower_face.CORNER[1]
    x = np.abs(np.arange(lower_face.WIDTH) + 0.5 + lower_face.CORNER[0])
    untouched = (y < lower_face.STILL_PX)[:, None] | (y > CHIN_PX + 8 + 4 + lower_face.NECK_PX)[:, None]
    untouched = untouched | (x >= lower_face.SIDE_PX[1])
    assert np.array_equal(moved[:, untouched], before[:, untouched])
    assert (moved != before)[:, ~untouched].mean() > 0.5


def test_the_jaw_moves_less_towards_its_joints() -> None:
    picture = with_line()
    moved = lower_face.move_chin(picture, np.array([CHIN_PX]), np.array([10.0]))
    steps = [line_px(moved[0], x) - line_px(picture[0], x) for x in (0.5, 20.5, 40.5, 50.5)]
    assert steps[0] > steps[1] + 0.3 > steps[2] + 1 > steps[3]
    mirrored = [line_px(moved[0], -x) - line_px(picture[0], -x) for x in (0.5, 20.5, 40.5, 50.5)]
    assert mirrored == pytest.approx(steps, abs=0.05)


def test_no_chin_folds_or_tears() -> None:
    """A picture that gets lighter downwards still does. Short chins, of children or a tracker's errors, move less."""
    ramp = np.tile(np.arange(lower_face.HEIGHT, dtype=np.uint8)[:, None, None], (1, lower_face.WIDTH, 3))
    chins = np.repeat([60.0, 80.0, 86.0, 92.0, 99.0, CHIN_PX], 2)
    drops = np.tile([-lower_face.LARGEST_PX, lower_face.LARGEST_PX], 6)
    above = round(lower_face.STILL_PX - lower_face.CORNER[1])
    for moved in lower_face.move_chin(np.repeat(ramp[None], 12, axis=0), chins, drops).astype(int):
        assert np.array_equal(moved[:above], ramp[:above])
        steps = np.diff(moved[:, lower_face.WIDTH // 2, 0])
        assert steps.min() >= 0
        assert steps.max() <= 5
