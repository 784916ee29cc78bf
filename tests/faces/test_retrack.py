import numpy as np
import pytest

from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion_faces import Staging, head, stage_face

pytestmark = pytest.mark.video

INNER_LIPS, CORNERS, OUTER_LIPS, EYES = (13, 14), (61, 291), (0, 17), (33, 263)


def syllables() -> tuple[Motion, Timeline[Unit]]:
    """Three seconds: silence, then syllables of different openings and widths that begin with closed lips."""
    time_s = np.arange(301) / 100
    said = (time_s > 0.4) & (time_s < 2.6)
    number = ((time_s - 0.4) / 0.2).astype(int) % 4
    sizes, widths = np.array([0.08, 0.16, 0.05, 0.22])[number], np.array([0.05, 0.0, -0.1, -0.03])[number]
    beat = np.where(said, np.sin(np.pi * ((time_s - 0.4) % 0.2) / 0.2) ** 2, 0)
    opening = sizes * beat
    values = np.stack([opening, 0.56 + widths * beat, 0.22 + opening], axis=1)
    silence = Timeline((Span(0.0, 0.4, Unit("sil")), Span(2.6, 3.01, Unit("sil"))))
    return Motion(values, 100.0, tuple(map(Channel, ("opening", "width", "outer")))), silence


def tracked(frames: list[np.ndarray]) -> np.ndarray:
    """Return opening, width and outer of each frame [shape=(T, 3)]; NaN where no face was found."""
    rows = []
    mediapipe = pytest.importorskip("mediapipe")
    with mediapipe.solutions.face_mesh.FaceMesh(max_num_faces=1, refine_landmarks=True) as mesh:
        for frame in frames:
            faces = mesh.process(frame).multi_face_landmarks
            points = np.array([(p.x, p.y) for p in faces[0].landmark]) if faces else np.full((478, 2), np.nan)
            pairs = points[[INNER_LIPS, CORNERS, OUTER_LIPS, EYES]]
            distances = np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1)
            rows.append(distances[:3] / distances[3])
    return np.array(rows)


FACES = {
    "woman": (lambda: stage_face("woman", Staging(size=480)), (0.95, 0.85, 0.9), 1.25),
    "head": (lambda: head.Head(size=(720, 720)), (0.97, 0.9, 0.95), 1.35),
}
"""Faces, how closely what is measured follows opening, width and outer, and the largest ratio of the openings."""


@pytest.mark.long
@pytest.mark.parametrize("name", FACES)
def test_the_drawn_motion_is_tracked_as_large_as_given_and_closed_where_closed(name):
    face, correlations, largest = FACES[name]
    motion, units = syllables()
    drawn, measured = motion.resampled(25.0).values, tracked(list(face().render(motion, units, fps=25.0)))
    assert np.isfinite(measured).all()  # the face is found in every frame
    for column, least in enumerate(correlations):
        assert np.corrcoef(drawn[:, column], measured[:, column])[0, 1] >= least
    assert 0.9 < np.polyfit(drawn[:, 0], measured[:, 0], 1)[0] < largest
    assert measured[drawn[:, 0] < 0.01, 0].max() < 0.02
