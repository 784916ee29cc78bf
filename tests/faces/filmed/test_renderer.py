from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from lipmotion.errors import InputError
from lipmotion.types import Motion
from lipmotion_faces.appearance import lower_face, placing
from lipmotion_faces.appearance.candidates import STEADY, RefinementOptions
from lipmotion_faces.appearance.person import Appearance, FaceCodes
from lipmotion_faces.filmed import face, renderer
from lipmotion_faces.filmed.renderer import BATCH, Background, Stitcher, StitchingOptions
from testing.toy import toy_motion, toy_sentences
from testing.toy_face import FRAME_HEIGHT, FRAME_WIDTH, toy_chin_px, toy_frames, toy_places

FRAMES = 24  # more than one batch


@pytest.fixture(scope="module")
def appearance(filmed_face: face.FilmedFace) -> Appearance:
    return filmed_face.appearance


@pytest.fixture(scope="module")
def spoken() -> Motion:
    """The middle of a sentence, which the mouth opens and closes in."""
    motion = toy_motion(toy_sentences(4)[3].units, 25.0)
    return Motion(motion.values[20 : 20 + FRAMES], 25.0, motion.channels)


@pytest.fixture(scope="module")
def backgrounds(spoken: Motion) -> list[Background]:
    return footage_of(spoken)


@pytest.fixture(scope="module")
def backwards(appearance: Appearance, backgrounds: list[Background], spoken: Motion) -> tuple[FaceCodes, np.ndarray]:
    """What the lower face is like in the sentence said backwards, and the frames of it."""
    codes = appearance.predict_codes(Motion(spoken.values[::-1], 25.0, spoken.channels))
    return codes, stitched(appearance, codes, backgrounds)


def footage_of(motion: Motion, **more: float) -> list[Background]:
    places = toy_places(len(motion.values))
    frames = toy_frames(motion, places, **more)  # type: ignore[arg-type]
    chins = toy_chin_px(motion)
    return [Background(frame, place, float(chin)) for frame, place, chin in zip(frames, places, chins, strict=True)]


def closed(motion: Motion) -> Motion:
    """The same person, silent."""
    return Motion(np.tile([[0.0, 0.55, 0.22]], (len(motion.values), 1)), motion.rate_hz, motion.channels)


def codes_in(appearance: Appearance, backgrounds: list[Background]) -> FaceCodes:
    """What the lower face is like in the footage itself."""
    faces = [placing.cut(each.frame, lower_face.map_region(each.face_to_frame, 1), (128, 128)) for each in backgrounds]
    mouths = np.clip(np.rint(np.stack(faces)), 0, 255).astype(np.uint8)[(slice(None), *lower_face.find_mouth_part(1))]
    chins = np.array([each.chin_px for each in backgrounds], np.float32)
    return replace(appearance.measure_codes(mouths), chin_px=chins)


def part_in_frame(part: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return which pixels of the frame look at a part of the lower face, or have a neighbour that does."""
    rows, columns = np.mgrid[:FRAME_HEIGHT, :FRAME_WIDTH]
    to_frame = lower_face.map_region(place, 1)
    position = np.linalg.solve(to_frame[:, :2], np.stack([columns.ravel(), rows.ravel()]) - to_frame[:, 2:])
    x, y = (np.floor(each).astype(int) for each in position)
    found = np.zeros(rows.size, bool)
    for right in (0, 1):
        for down in (0, 1):
            inside = (x + right >= 0) & (x + right < 128) & (y + down >= 0) & (y + down < 128)
            found[inside] |= part[y[inside] + down, x[inside] + right]
    return found.reshape(rows.shape)


def stitched(appearance: Appearance, codes: FaceCodes, backgrounds: list[Background], **options: object) -> np.ndarray:
    """Return the frames [shape=(T, H, W, 3)], whole numbers."""
    stitcher = Stitcher(appearance, StitchingOptions(**options))  # type: ignore[arg-type]
    return np.stack(list(stitcher.stitch(codes, backgrounds))).astype("i4")


@pytest.mark.parametrize("jaw", [True, False])
def test_a_face_in_its_own_footage_is_that_footage(
    appearance: Appearance, backgrounds: list[Background], jaw: bool
) -> None:
    made = stitched(appearance, codes_in(appearance, backgrounds), backgrounds, jaw=jaw)
    footage = np.stack([each.frame for each in backgrounds]).astype("i4")
    part = lower_face.mark_moved(1) if jaw else lower_face.mark_mouth(1)
    inside = np.stack([part_in_frame(part, each.face_to_frame) for each in backgrounds])
    difference = np.abs(made - footage)[inside]
    assert difference.mean() < 3
    assert np.percentile(difference, 95) < 10


def test_outside_nothing_changes_and_a_frame_without_a_face_stays_as_it_is(
    appearance: Appearance, backgrounds: list[Background], backwards: tuple[FaceCodes, np.ndarray]
) -> None:
    """To the bit; and the given frames are not changed."""
    codes, made = backwards
    hidden = [replace(each, has_face=n not in (3, BATCH + 1)) for n, each in enumerate(backgrounds)]
    footage = np.stack([each.frame for each in backgrounds])
    alone = stitched(appearance, codes, hidden, jaw=False)
    assert np.array_equal(np.stack([each.frame for each in backgrounds]), footage)
    for n, each in enumerate(hidden):
        assert np.array_equal(alone[n], each.frame) == (not each.has_face)
    for frames, part in ((made, lower_face.mark_moved(1)), (alone, lower_face.mark_mouth(1))):
        outside = ~np.stack([part_in_frame(part, each.face_to_frame) for each in backgrounds])
        assert np.array_equal(frames[outside], footage[outside])
        assert (frames[~outside] != footage[~outside]).mean() > 0.3
        assert outside.mean() > 0.5


def fine_mouths(appearance: Appearance, codes: FaceCodes, options: RefinementOptions = STEADY) -> np.ndarray:
    mouths = Stitcher(appearance, StitchingOptions(mouth=options, noise=False)).draw_mouths(codes)
    return fine(np.stack(list(mouths)))


def fine(mouths: np.ndarray) -> np.ndarray:
    return np.asarray(mouths - gaussian_filter(mouths.astype(float), 1.0, axes=(1, 2)))


def test_the_edges_of_the_lips_are_those_of_one_recorded_mouth(appearance: Appearance, spoken: Motion) -> None:
    codes, recorded = replace(appearance.predict_codes(spoken), width=None), fine(appearance.mouths)
    apart = []
    for options in (STEADY, replace(STEADY, blur_px=0.0)):
        made = fine_mouths(appearance, codes, options)
        apart.append(np.mean([np.square(recorded - each).mean(axis=(1, 2, 3)).min() for each in made]))
    assert apart[0] < 0.5 * apart[1]


def test_a_recorded_mouth_is_made_as_wide_as_the_motion(appearance: Appearance, spoken: Motion) -> None:
    codes = appearance.predict_codes(spoken)
    assert codes.width is not None
    from_middle = np.abs(np.arange(72) - 35.5)
    reach = [
        np.average(from_middle, weights=np.square(fine_mouths(appearance, replace(codes, width=width))).sum((0, 1, 3)))
        for width in (0.95 * codes.width, 1.05 * codes.width)
    ]
    assert 1.06 * reach[0] < reach[1]


def test_half_of_the_noise_of_the_camera_is_added(appearance: Appearance, spoken: Motion) -> None:
    codes = appearance.predict_codes(spoken)
    clean, half, full = (
        np.stack(list(Stitcher(appearance, options).draw_mouths(codes))).astype(float)
        for options in (StitchingOptions(noise=0), StitchingOptions(), StitchingOptions(noise=1))
    )
    assert 0.4 < (half - clean).std() / (full - clean).std() < 0.6


@pytest.mark.long
def test_a_silent_mouth_onto_a_talking_one(
    appearance: Appearance, backgrounds: list[Background], spoken: Motion
) -> None:
    """The footage's own mouth does not shine through, and its chin goes up."""
    silent = closed(spoken)
    made = stitched(appearance, appearance.predict_codes(silent), backgrounds)
    wanted = np.stack([each.frame for each in footage_of(silent, noise=0.0)]).astype("i4")
    footage = np.stack([each.frame for each in backgrounds]).astype("i4")
    inside = np.stack([part_in_frame(lower_face.mark_moved(1), each.face_to_frame) for each in backgrounds])
    talks = spoken["opening"] > 0.12
    assert talks.sum() >= 4
    errors = [np.square((each - wanted)[talks][inside[talks]]).mean() for each in (made, footage)]
    assert errors[0] < 0.25 * errors[1]
    dark = [(each < 90).all(axis=3) & inside for each in (made, footage)]
    assert dark[1][talks].sum(axis=(1, 2)).min() > 100
    assert dark[0].sum(axis=(1, 2)).max() < 60


def test_the_light_is_the_footages(appearance: Appearance, backgrounds: list[Background], spoken: Motion) -> None:
    """Under another lamp the same frames are made, under that lamp."""
    lamp = np.array([(1.1, 0.9, 0.7)])
    lit = [replace(each, frame=lower_face.relight(each.frame[None], lamp)[0]) for each in backgrounds[:8]]
    codes = appearance.predict_codes(Motion(np.tile([[0.2, 0.55, 0.42]], (8, 1)), 25.0, spoken.channels))
    plain, made = (stitched(appearance, codes, each) for each in (backgrounds[:8], lit))
    wanted = lower_face.relight(plain.astype(np.uint8), np.repeat(lamp, 8, axis=0)).astype(int)
    assert np.abs(made - wanted).mean() < 0.5
    assert np.abs(made - wanted).max() <= 16  # what is sharpened is so in all colours alike


def test_frames_do_not_depend_on_the_batch_they_are_made_in(
    appearance: Appearance,
    backgrounds: list[Background],
    backwards: tuple[FaceCodes, np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The detail of the mouth is chosen for the whole speech, and the noise of a frame is that of its number."""
    codes, made = backwards
    monkeypatch.setattr(renderer, "BATCH", 7)
    assert (stitched(appearance, codes, backgrounds * 2) != made).mean() < 1e-5  # but for roundings
    other = next(iter(Stitcher(appearance, StitchingOptions(seed=1)).stitch(codes, backgrounds)))
    assert 0 < np.abs(other.astype(int) - made[0]).mean() < 1


def test_frames_are_taken_a_few_at_a_time(appearance: Appearance, spoken: Motion) -> None:
    backgrounds = footage_of(closed(spoken))[:4]
    taken = 0

    def endless() -> Iterator[Background]:
        nonlocal taken
        while True:
            taken += 1
            yield backgrounds[taken % 4]

    frames = Stitcher(appearance, StitchingOptions(jaw=False)).stitch(appearance.predict_codes(spoken), endless())
    next(frames)
    assert taken == BATCH
    assert len(list(frames)) == FRAMES - 1
    assert taken == FRAMES


def test_too_few_frames_of_background(appearance: Appearance, backgrounds: list[Background], spoken: Motion) -> None:
    frames = Stitcher(appearance).stitch(appearance.predict_codes(spoken), backgrounds[:-1])
    with pytest.raises(InputError, match=f"{FRAMES - 1} frames of background, required {FRAMES}; give longer footage"):
        list(frames)
    nothing = FaceCodes(np.zeros((0, 90), np.float32), np.zeros((0, 36), np.float32), np.zeros(0, np.float32))
    assert list(Stitcher(appearance).stitch(nothing, [])) == []
    assert list(Stitcher(appearance).draw_mouths(nothing)) == []
