"""Names of blendshapes, as files spell them."""

from __future__ import annotations

import pytest

from lipmotion.rig.shape_names import (
    ARKIT_MOUTH,
    ARKIT_OTHERS,
    VISEMES_15,
    arkit_name,
    viseme_name,
    vowel_name,
)


def test_there_are_52_and_15():
    assert len({*ARKIT_MOUTH, *ARKIT_OTHERS}) == 52
    assert len(set(VISEMES_15)) == 15


@pytest.mark.parametrize(
    ("spelled", "name"),
    [
        ("jawOpen", "jawOpen"),
        ("JawOpen", "jawOpen"),
        ("head.mouthSmile_L", "mouthSmileLeft"),
        ("blendShape1.mouthPress_R", "mouthPressRight"),
        ("mouth_funnel", "mouthFunnel"),
        ("Face_mouthLowerDownRight", "mouthLowerDownRight"),
        ("mouthSmile", None),
        ("Fcl_MTH_A", None),
        ("", None),
    ],
)
def test_arkit(spelled, name):
    assert arkit_name(spelled) == name


@pytest.mark.parametrize(
    ("spelled", "name"),
    [
        ("viseme_PP", "PP"),
        ("viseme_I", "ih"),
        ("vrc.v_oh", "oh"),
        ("Viseme_aa", "aa"),
        ("viseme_ZZ", None),
        ("aa", None),
    ],
)
def test_visemes(spelled, name):
    assert viseme_name(spelled) == name


@pytest.mark.parametrize(
    ("spelled", "name"), [("Fcl_MTH_A", "aa"), ("aa", "aa"), ("oh", "oh"), ("Fcl_MTH_Angry", None), ("Alpha", None)]
)
def test_vowels(spelled, name):
    assert vowel_name(spelled) == name
