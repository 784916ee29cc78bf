"""Names of blendshapes, as files spell them."""

from __future__ import annotations

from lipmotion.meshes.model.shape_names import (
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


def test_names_as_files_spell_them():
    arkit = {
        "jawOpen": "jawOpen", "JawOpen": "jawOpen",
        "mouth_funnel": "mouthFunnel", "head.mouthSmile_L": "mouthSmileLeft",
        "blendShape1.mouthPress_R": "mouthPressRight", "Face_mouthLowerDownRight": "mouthLowerDownRight",
        "jawOpen.001": "jawOpen", "mouth_smile_left.002": "mouthSmileLeft", "Face_mouthSmileL": "mouthSmileLeft",
        "JAW_OPEN": "jawOpen", "A25_Jaw_Open": "jawOpen", "Head|jawOpen_12": "jawOpen",
        "mouthSmile": None, "Fcl_MTH_A": None, "": None, "001": None,
    }  # fmt: skip
    assert {spelled: arkit_name(spelled) for spelled in arkit} == arkit
    visemes = {
        "viseme_PP": "PP",
        "viseme_I": "ih",
        "vrc.v_oh": "oh",
        "Viseme_aa": "aa",
        "viseme_ZZ": None,
        "viseme_PP.001": "PP",
        "aa": None,
    }
    assert {spelled: viseme_name(spelled) for spelled in visemes} == visemes
    vowels = {
        "Fcl_MTH_A": "aa",
        "Fcl_MTH_O.003": "oh",
        "aa": "aa",
        "う": "ou",
        "oh": "oh",
        "Fcl_MTH_Angry": None,
        "Alpha": None,
    }
    assert {spelled: vowel_name(spelled) for spelled in vowels} == vowels
