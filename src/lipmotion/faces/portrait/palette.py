"""The colours of the portrait, RGB."""

Colour = tuple[int, int, int]

WALL: Colour = (214, 226, 228)
WALL_LIGHT: Colour = (240, 243, 239)
WHITE: Colour = (255, 255, 255)
GOLD: Colour = (232, 186, 92)

SKIN: Colour = (242, 190, 156)
SKIN_LIGHT: Colour = (255, 219, 190)
SKIN_SHADE: Colour = (214, 140, 108)
SKIN_DEEP: Colour = (172, 98, 74)
BLUSH: Colour = (236, 132, 112)

HAIR: Colour = (82, 48, 40)
HAIR_DARK: Colour = (56, 31, 28)
HAIR_LIGHT: Colour = (132, 80, 58)

CLOTH: Colour = (44, 92, 104)
CLOTH_LIGHT: Colour = (72, 128, 138)
CLOTH_DARK: Colour = (30, 66, 78)

EYE_WHITE: Colour = (252, 248, 244)
EYE_SHADE: Colour = (150, 128, 128)
EYE_CORNER: Colour = (226, 150, 134)
IRIS: Colour = (92, 122, 98)
IRIS_LIGHT: Colour = (152, 176, 128)
IRIS_DARK: Colour = (42, 60, 52)
PUPIL: Colour = (24, 20, 22)

UPPER_LIP_LIGHT: Colour = (206, 104, 96)
UPPER_LIP_DARK: Colour = (172, 70, 70)
LOWER_LIP_LIGHT: Colour = (222, 118, 108)
LOWER_LIP_DARK: Colour = (188, 84, 80)
GLOSS: Colour = (255, 196, 182)
SEAM: Colour = (112, 36, 40)
CAVITY: Colour = (58, 14, 22)
TOOTH: Colour = (250, 246, 238)
LOWER_TOOTH: Colour = (232, 222, 212)
TONGUE: Colour = (214, 104, 104)
MOUTH_SHADOW: Colour = (150, 76, 58)
