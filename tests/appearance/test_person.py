from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lipmotion import FilmedFace
from lipmotion.errors import InputError
from lipmotion.stats.pca import choose_evenly
from lipmotion.types import Motion
from lipmotion_faces.appearance import person
from lipmotion_faces.appearance.candidates import CANDIDATES
from lipmotion_faces.appearance.lower_face import cheek_light, mouth_ellipse, mouth_part, relight, replaced_part
from lipmotion_faces.appearance.person import EDGE_PX, JAW_CANDIDATES, Appearance, FootagePictures, learn_appearance
from testing.toy import toy_motion, toy_sentences
from testing.toy_face import NOISE, SHAPE, toy_chin_px, toy_footage_pictures, toy_lower_faces

MOUTH = (slice(None), *mouth_part(1))


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
def unseen() -> Motion:
    """Of a sentence that the appearance was not learned from."""
    return toy_motion(toy_sentences(8)[6].units, 25.0)


def test_its_parts(appearance: Appearance, footage: FootagePictures) -> None:
    count = len(footage.motion)
    assert (appearance.shape, appearance.scale) == (SHAPE, 1)
    assert appearance.mouth_codes.shape == (len(appearance.mouths), 90)
    assert 200 < len(appearance.mouths) <= min(CANDIDATES, count)
    assert appearance.jaw_codes.shape == (len(appearance.jaws), 36)
    assert len(appearance.jaws) == JAW_CANDIDATES
    assert appearance.from_motion.names == ("opening", "width", "outer")
    assert (appearance.mouth.explained > 0.98).all()
    assert np.sqrt(np.diag(appearance.noise.covariance)) == pytest.approx([NOISE] * 3, rel=0.05)
    light = np.median(cheek_light(np.concatenate(footage.clips)[MOUTH]), axis=0)
    assert appearance.light == pytest.approx(light)


def test_motion_becomes_the_mouth_that_was_drawn(appearance: Appearance, unseen: Motion) -> None:
    codes, drawn = appearance.predict_codes(unseen), toy_lower_faces(unseen, noise=0)[MOUTH].astype(float)
    assert len(codes) == len(unseen.values)
    shown = appearance.mouth.restore(codes.mouth).astype(float)
    mean = drawn.mean(axis=0)
    assert np.square(shown - drawn).mean() < 0.4 * np.square(mean - drawn).mean()
    dark = [(mouths < 90).all(axis=3).sum(axis=(1, 2)) for mouths in (shown, drawn)]
    assert np.corrcoef(dark)[0, 1] > 0.95  # the mouth opens when it should
    assert codes.chin_px == pytest.approx(toy_chin_px(unseen), abs=1.5)


def test_mouths_are_as_wide_as_the_motion(appearance: Appearance, distances: np.ndarray, unseen: Motion) -> None:
    """A regression alone draws them to the mean; a person's own recorded mouths are the limit."""
    order = distances[:, 1].argsort()
    narrow, wide = (appearance.mouth_codes[ends] for ends in (order[:20], order[-20:]))
    for width, near, far in ((np.percentile(distances[:, 1], 5), narrow, wide), (9.0, wide, narrow)):
        values = unseen.values.copy()
        values[:, unseen.column("width")] = width
        shown = appearance.predict_codes(Motion(values, 25.0, unseen.channels)).mouth
        likeness = [np.linalg.norm(shown[:, None] - each, axis=2).min(axis=1).mean() for each in (near, far)]
        assert likeness[0] < likeness[1]


def test_a_closure_shows_a_recorded_mouth_that_is_closed(
    appearance: Appearance, distances: np.ndarray, unseen: Motion
) -> None:
    contact = np.zeros(len(unseen.values))
    contact[[9, 13]], contact[10:13] = 0.5, 1.0
    values = unseen.values.copy()
    values[10:13, unseen.column("opening")] = 0.0
    motion = Motion(values, 25.0, unseen.channels)
    mixed, closed = appearance.predict_codes(motion).mouth, appearance.predict_codes(motion, contact).mouth
    apart = np.linalg.norm(appearance.mouth_codes - closed[11], axis=1)
    assert apart.min() < 1e-3 * np.linalg.norm(closed[11])
    assert distances[apart.argmin(), 0] < 0.01
    assert closed[10:12] == pytest.approx(closed[11:13], abs=1e-3)
    assert closed[9] == pytest.approx((mixed[9] + closed[11]) / 2, abs=1e-2)
    assert np.array_equal(closed[14:], mixed[14:])
    pause = appearance.predict_codes(motion, np.ones(len(values))).mouth  # too long for a closure
    assert np.array_equal(pause, mixed)


def test_pictures_of_the_mouth_in_any_light(appearance: Appearance, unseen: Motion) -> None:
    drawn = toy_lower_faces(unseen, noise=0)[MOUTH]
    dim = relight(drawn, np.tile([0.6, 0.7, 0.9], (len(drawn), 1)))
    bright, dark = appearance.measure_codes(drawn), appearance.measure_codes(dim)
    assert bright.chin_px == pytest.approx(toy_chin_px(unseen), abs=1.0)
    assert dark.chin_px == pytest.approx(bright.chin_px, abs=0.3)
    assert np.abs(dark.mouth - bright.mouth).max() < 0.02 * np.abs(bright.mouth).max()
    assert np.abs(dark.jaw - bright.jaw).max() < 0.05 * np.abs(bright.jaw).max()


def test_a_jaw_of_sound_is_the_least_squares_line_of_its_level(
    appearance: Appearance, footage: FootagePictures, unseen: Motion
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


def test_jaws_differ_in_the_jaw_alone(appearance: Appearance) -> None:
    """Their mouth is the mean one, and so is what is further away from the jaw than cloning reads."""
    same = (appearance.jaws == appearance.jaws[0]).all(axis=(0, 3))
    inside = replaced_part(SHAPE, 1)
    assert same[mouth_ellipse(1)].all()
    assert not same[inside & ~mouth_ellipse(1)].any()
    rows, columns = np.nonzero(~same)
    reach = np.nonzero(inside)
    for found, wanted in ((rows, reach[0]), (columns, reach[1])):
        assert (found.min(), found.max()) == (wanted.min() - EDGE_PX, wanted.max() + EDGE_PX)


@pytest.mark.long
def test_all_pictures_are_in_one_light(footage: FootagePictures) -> None:
    """A clip under another lamp is learned as if it had been the same."""
    lamp = np.tile([0.7, 0.8, 0.9], (len(footage.clips[1]), 1))
    dimmed = replace(footage, clips=(footage.clips[0], relight(footage.clips[1], lamp), *footage.clips[2:]))
    found, wanted = learn_appearance(dimmed), learn_appearance(footage)
    assert found.light == pytest.approx(wanted.light, abs=0.5)
    assert cheek_light(found.mouths) == pytest.approx(np.tile(found.light, (len(found.mouths), 1)), abs=0.5)
    motion = Motion(footage.motion[::5], 25.0, footage.channels)
    pictures = [each.mouth.restore(each.predict_codes(motion).mouth).astype(int) for each in (found, wanted)]
    assert np.abs(pictures[0] - pictures[1]).mean() < 1.0


@pytest.mark.long
def test_damaged_pictures_are_no_candidates(footage: FootagePictures, monkeypatch: pytest.MonkeyPatch) -> None:
    """A blue square, as errors of video leave it, in a picture from which no component is learned."""
    monkeypatch.setattr(person, "TRAINING_PICTURES", 120)
    learned = set(choose_evenly(120, len(footage.motion)))
    damaged = next(n for n in range(20, 60) if n not in learned)
    clip = footage.clips[0].copy()
    rows, columns = mouth_part(1)
    clip[damaged, rows.start + 20 : rows.start + 28, columns.start + 30 : columns.start + 38] = [0, 0, 255]
    found = learn_appearance(replace(footage, clips=(clip, *footage.clips[1:])))
    whole = learn_appearance(footage)
    assert len(found.mouths) == len(whole.mouths) - 1
    blue = (found.mouths[:, 20:28, 30:38].astype(int) @ [-1, -1, 1]).mean(axis=(1, 2))
    assert blue.max() < 100


@pytest.mark.parametrize(
    ("wrong", "counts"),
    [("motion", "266 pictures, 265 .*266 of"), ("levels_db", "266 pictures, 266 .*265 of"), ("clips", "0 pictures")],
)
def test_footage_that_does_not_fit_together(footage: FootagePictures, wrong: str, counts: str) -> None:
    part: Any = () if wrong == "clips" else getattr(footage, wrong)[:-1]
    with pytest.raises(InputError, match=counts):
        learn_appearance(replace(footage, **{wrong: part}))
