from __future__ import annotations

import numpy as np
import pytest

from lipmotion.measures.sync_confidence import sync_confidence

FACES = np.random.default_rng(0).normal(size=(40, 4)).astype(np.float32)


@pytest.mark.parametrize("late", [-15, -2, 0, 7])
def test_the_offset_is_that_of_the_sound(late: int) -> None:
    sounds = np.roll(FACES, late, axis=0)
    assert sync_confidence(FACES, sounds).late_ms == pytest.approx(40 * late)


def test_figures_by_hand() -> None:
    sounds = (np.roll(FACES, 3, axis=0) + 0.5).astype(np.float32)[:38]
    distances = []
    for offset in range(-15, 16):
        heard = [sounds[t + offset] if 0 <= t + offset < 38 else np.zeros(4) for t in range(38)]
        distances.append(sum(np.sqrt(((FACES[t] - heard[t]) ** 2).sum()) for t in range(38)) / 38)
    found = sync_confidence(FACES, sounds)
    assert found.distance == pytest.approx(min(distances))
    assert found.confidence == pytest.approx(sorted(distances)[15] - min(distances))
    assert found.vectors == 38
