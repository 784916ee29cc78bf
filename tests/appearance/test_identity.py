from __future__ import annotations

import numpy as np
import pytest

from lipmotion_faces.appearance.lower_face import SAME_PERSON_LIKENESS, face_signature, likeness


def face(seed: int) -> np.ndarray:
    coarse = np.random.default_rng(seed).uniform(40, 200, (16, 16, 3))
    return np.kron(coarse, np.ones((8, 8, 1)))


def test_light_and_noise_leave_a_person_the_same() -> None:
    draw = np.random.default_rng(9)
    one = np.stack([face(1) + draw.normal(0, 5, (128, 128, 3)) for _ in range(4)])
    assert likeness(face_signature(one), face_signature(0.6 * one[:1] + 20)) == pytest.approx(1, abs=0.02)


def test_other_faces_and_neck_and_background() -> None:
    other = face(1)
    other[112:] = 0
    other[:, :18] = 255
    assert likeness(face_signature(face(1)), face_signature(face(2))) < SAME_PERSON_LIKENESS
    assert likeness(face_signature(face(1)), face_signature(other)) == pytest.approx(1)


def test_a_flat_picture_is_like_nothing() -> None:
    assert likeness(face_signature(np.full((128, 128, 3), 7)), face_signature(face(1))) == pytest.approx(0)
