"""The colours of a drawn character, RGB."""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[int, int, int]

WHITE: Colour = (255, 255, 255)


@dataclass(frozen=True)
class Palette:
    """The colours of a character. The defaults are those of the woman."""

    wall: Colour = (214, 226, 228)
    wall_light: Colour = (240, 243, 239)
    gold: Colour = (232, 186, 92)
    skin: Colour = (242, 190, 156)
    skin_light: Colour = (255, 219, 190)
    skin_shade: Colour = (214, 140, 108)
    skin_deep: Colour = (172, 98, 74)
    blush: Colour = (236, 132, 112)
    hair: Colour = (82, 48, 40)
    hair_dark: Colour = (56, 31, 28)
    hair_light: Colour = (132, 80, 58)
    cloth: Colour = (44, 92, 104)
    cloth_light: Colour = (72, 128, 138)
    cloth_dark: Colour = (30, 66, 78)
    eye_white: Colour = (252, 248, 244)
    eye_shade: Colour = (150, 128, 128)
    eye_corner: Colour = (226, 150, 134)
    iris: Colour = (92, 122, 98)
    iris_light: Colour = (152, 176, 128)
    iris_dark: Colour = (42, 60, 52)
    lashes: Colour = (56, 31, 28)
    pupil: Colour = (24, 20, 22)
    upper_lip_light: Colour = (206, 104, 96)
    upper_lip_dark: Colour = (172, 70, 70)
    lower_lip_light: Colour = (222, 118, 108)
    lower_lip_dark: Colour = (188, 84, 80)
    gloss: Colour = (255, 196, 182)
    seam: Colour = (112, 36, 40)
    cavity: Colour = (58, 14, 22)
    tooth: Colour = (240, 230, 216)
    lower_tooth: Colour = (232, 218, 204)
    tongue: Colour = (230, 124, 138)
    mouth_shadow: Colour = (150, 76, 58)
    beard: Colour = (150, 112, 100)
    collar: Colour = (238, 240, 240)
    collar_dark: Colour = (190, 196, 200)
    line: Colour = (60, 34, 36)
