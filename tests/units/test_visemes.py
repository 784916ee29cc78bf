from __future__ import annotations

from lipmotion.units import VISEMES

TABLE_1 = """
sip sil sp
lr1 ao aa ah er oy aw hh
lr2 uw uh ow em
lr3 ae eh ey ay
lr4 ih iy ax axr ix
as  l el r y
af  s z
al  t d n en
pa  sh zh ch jh
bi  p b m
de  th dh
ld  f v
ve  ng k g w
"""
"""Xie & Liu 2007, Table 1, copied from the paper line by line."""


def test_the_visemes_are_those_of_the_paper() -> None:
    printed = {line.split()[0]: tuple(line.split()[1:]) for line in TABLE_1.strip().splitlines()}
    assert printed == VISEMES
    assert len(VISEMES) == 13
