"""MPEG-4 parameters: 0 at rest, lips that meet, and the directions of the standard."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.articulation.contact import opening_to_gap
from lipmotion.formats.fap import MOUTH_TO_NOSE, STEPS, move_faps
from meshes.speech import motion, units


@pytest.fixture(scope="module")
def parameters():
    return move_faps(motion(), units())


def test_rest_is_0(parameters):
    assert np.abs(parameters.values[5:30]).max() <= 1


def test_lips_meet_in_p_and_m(parameters):
    apart = parameters["fap4_lower_t_midlip"] + parameters["fap5_raise_b_midlip"]
    assert np.abs(apart[[55, 95]]).max() <= 1


def test_the_directions_are_those_of_the_standard(parameters):
    assert parameters["fap3_open_jaw"][75] > 0
    assert parameters["fap5_raise_b_midlip"][75] < 0
    assert parameters["fap4_lower_t_midlip"][75] < 0
    assert parameters["fap6_stretch_l_cornerlip"][115] < 0  # oo is narrow
    assert parameters["fap7_stretch_r_cornerlip"][115] < 0


def test_a_gap_is_its_share_of_the_unit(parameters):
    apart = -(parameters["fap4_lower_t_midlip"][75] + parameters["fap5_raise_b_midlip"][75])
    assert apart / STEPS * MOUTH_TO_NOSE == pytest.approx(
        float(opening_to_gap(motion()["opening"][75:76].astype(float))[0]), abs=0.002
    )


def test_values_are_whole(parameters):
    np.testing.assert_allclose(parameters.values, np.rint(parameters.values), atol=1e-12)
