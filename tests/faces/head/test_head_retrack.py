"""A face tracker measures on the rendered head the motion that was rendered."""

import numpy as np
import pytest

from faces.test_retrack import syllables, tracked
from lipmotion_faces.head import render

pytestmark = [pytest.mark.video, pytest.mark.long]
mediapipe = pytest.importorskip("mediapipe")


@pytest.fixture(scope="module")
def rendered_and_tracked() -> tuple[np.ndarray, np.ndarray]:
    motion, units = syllables()
    frames = list(render(motion, units, fps=25.0, width=720, height=720))
    return motion.resampled(25.0).values, tracked(frames)


def test_the_rendered_motion_is_tracked(rendered_and_tracked):
    given, measured = rendered_and_tracked
    assert np.isfinite(measured).all()  # the face is found in every frame
    for column, least in enumerate((0.97, 0.9, 0.95)):  # opening, width, outer
        assert np.corrcoef(given[:, column], measured[:, column])[0, 1] >= least


def test_the_opening_is_tracked_at_its_size(rendered_and_tracked):
    given, measured = rendered_and_tracked[0][:, 0], rendered_and_tracked[1][:, 0]
    assert 0.9 < np.polyfit(given, measured, 1)[0] < 1.35
    assert measured[given < 0.01].max() < 0.02
