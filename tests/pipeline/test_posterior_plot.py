from dataclasses import replace

import numpy as np
from PIL import Image

from formats.examples import of_motion
from lipmotion.pipeline.generate.explain import (
    COLOURS,
    LEFT_PX,
    MAX_COLUMNS,
    MIN_COLUMNS,
    RIGHT_PX,
    ROW_PX,
    TITLE_PX,
    draw_posteriors,
)
from lipmotion.types import ChainPosteriors, Channel, Generation, Motion, Span, Timeline, Unit

FRAMES = 400


def posteriors(name: str, probability: np.ndarray, lead: np.ndarray | None = None) -> ChainPosteriors:
    units = tuple(f"u{number}" for number in range(probability.shape[1]))
    leads = () if lead is None else (-1, 0, 1)
    given = np.zeros((len(probability), 0)) if lead is None else lead
    return ChainPosteriors(name, units, probability.astype(np.float32), leads, given.astype(np.float32))


def generated(frames: int = FRAMES, name: str = "opening") -> Generation:
    values = 0.2 * np.sin(np.arange(frames) / 20)[:, None] ** 2
    half = frames / 200
    units = Timeline((Span(0.0, half, Unit("aa", "aa")), Span(half, 2 * half, Unit("m", "m"))))
    return of_motion(Motion(values, 100.0, (Channel(name),)), units)


def halves(frames: int = FRAMES) -> np.ndarray:
    """Return probabilities of four units: the first in one half, the second in the other, the others seldom."""
    early = (np.arange(frames) < frames // 2).astype(float)
    sometimes = np.where(np.arange(frames) == frames - 1, 0.5, 0.2)
    return np.stack([1 - early, early, sometimes, np.full(frames, 0.04)], axis=1)


def pixels(picture: Image.Image) -> np.ndarray:
    return np.asarray(picture.convert("RGB")).astype(int)


def test_units_have_a_row_each_in_the_order_of_their_time():
    shown = pixels(draw_posteriors(generated(), [posteriors("phone", halves())]))
    rows = [2 * TITLE_PX + ROW_PX * number + ROW_PX // 2 for number in range(3)]
    early, late = LEFT_PX + 100, LEFT_PX + 2 * FRAMES - 100
    full, white = list(COLOURS[0]), [255, 255, 255]
    assert shown[rows[0], early].tolist() == full
    assert shown[rows[0], late].tolist() == white
    assert shown[rows[1], early].tolist() == white
    assert shown[rows[1], late].tolist() == full
    faint = [round(255 + 0.2 * (part - 255)) for part in full]
    assert shown[rows[2], early].tolist() == shown[rows[2], late].tolist() == faint


def test_units_that_are_never_likely_have_no_row():
    three, four = halves(), halves()
    four[9, 3] = 0.06
    heights = [draw_posteriors(generated(), [posteriors("phone", probability)]).height for probability in (three, four)]
    assert heights[1] - heights[0] == ROW_PX


def test_where_nothing_is_likely_there_is_a_picture_all_the_same():
    few = draw_posteriors(generated(), [posteriors("phone", np.full((FRAMES, 30), 1 / 30))])
    assert few.height > draw_posteriors(generated(), [posteriors("phone", halves())]).height
    assert draw_posteriors(generated(), [posteriors("phone", np.zeros((FRAMES, 3)))]).height > 0


def test_the_asynchrony_is_a_panel_of_its_own():
    lead = np.tile([0.1, 0.3, 0.6], (FRAMES, 1))
    alone = draw_posteriors(generated(), [posteriors("phone", halves())])
    both = draw_posteriors(generated(), [posteriors("phone", halves()), posteriors("viseme", halves(), lead)])
    assert both.height > alone.height + 6 * ROW_PX
    shown = pixels(both)
    column = shown[:, LEFT_PX + 300].sum(axis=1)
    assert column[-(5 * TITLE_PX + 120) - 3 * ROW_PX :].min() < 700  # something is drawn above the opening


def test_recordings_of_any_length():
    for frames, columns in {1: MIN_COLUMNS, 400: 800, 5_345: MAX_COLUMNS}.items():
        picture = draw_posteriors(generated(frames), [posteriors("phone", halves(frames))])
        assert picture.width == LEFT_PX + columns + RIGHT_PX


def test_a_column_of_a_long_recording_is_the_mean_of_its_frames():
    probability = np.zeros((8 * MAX_COLUMNS, 1))
    probability[::4] = 1
    shown = pixels(draw_posteriors(generated(8 * MAX_COLUMNS), [posteriors("phone", probability)]))
    row = shown[2 * TITLE_PX + ROW_PX // 2, LEFT_PX + 10 : LEFT_PX + MAX_COLUMNS // 2 - 10]
    assert (row == [round(255 + 0.25 * (part - 255)) for part in COLOURS[0]]).all()


def test_phones_are_written_where_there_is_room():
    dense = Timeline(tuple(Span(s / 100, (s + 1) / 100, Unit("aa", "aa")) for s in range(FRAMES)))
    strips = []
    for units in (Timeline(()), dense, generated().units):
        picture = draw_posteriors(replace(generated(), units=units), [posteriors("phone", halves())])
        strips.append(pixels(picture.crop((LEFT_PX, 0, picture.width, TITLE_PX - 4))).min())
    assert strips[:2] == [255, 255]
    assert strips[2] < 200
