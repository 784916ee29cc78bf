"""Motions and labels that the tests of the head share."""

import numpy as np

from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion_faces.head import CharacterPose
from lipmotion_faces.head.figure import Figure
from lipmotion_faces.head.skin import RINGS, VISIBLE_RINGS
from lipmotion_faces.head.stage import Stage

NOTHING_SAID: Timeline[Unit] = Timeline(())


def opening(*values: float, rate_hz: float = 25.0) -> Motion:
    return Motion(np.array(values)[:, None], rate_hz, (Channel("opening"),))


def said(*phones: str, duration_s: float = 0.4) -> Timeline[Unit]:
    spans = (Span(duration_s * n, duration_s * (n + 1), Unit(phone)) for n, phone in enumerate(phones))
    return Timeline(tuple(spans))


def steady(phones: tuple[str, ...], values: float = 0.08, duration_s: float = 0.4) -> Motion:
    """Return a motion of one opening for as long as the phones take."""
    return opening(*[values] * (int(100 * duration_s) * len(phones) + 1), rate_hz=100.0)


def mouth_rows(figure: Figure) -> dict[str, np.ndarray]:
    """Return the vertices of the parts of the mouth: lips, wall, tongue, teeth (the lower ones), upper teeth."""
    lips, every = figure.skin.list_lip_rows(), np.arange(len(figure.weigh_turn()))
    inner = {name: every[figure.rows[name]] for name in ("tongue", "teeth", "upper teeth")}
    return {"lips": lips[1 : VISIBLE_RINGS + 1].ravel(), "wall": lips[VISIBLE_RINGS + 1 : RINGS].ravel(), **inner}


def parts_seen(stage: Stage, pose: CharacterPose) -> dict[str, np.ndarray]:
    """Return which pixels show lips, wall, tongue, teeth (lower) and upper teeth [each shape=(H, W)]."""
    places, _ = stage.figure.shade(pose, stage.canvas.camera.place)
    seen = {}
    for name, rows in mouth_rows(stage.figure).items():
        marked = np.zeros(len(places), bool)
        marked[rows] = True
        seen[name] = stage.canvas.cover(places, marked, stage.figure.triangles) > 127
    return seen
