"""Colours (sRGB, 0 to 1) and finishes of the character."""

from __future__ import annotations

from lipmotion_faces.rendering.lighting import Finish

SKIN = (0.95, 0.765, 0.675)
SKIN_LIGHT = (0.975, 0.80, 0.70)
BLUSH = (0.93, 0.50, 0.45)
SKIN_DEEP = (0.72, 0.40, 0.34)
LIP = (0.82, 0.43, 0.41)
LIP_DEEP = (0.62, 0.24, 0.25)
MOUTH = (0.50, 0.16, 0.16)
GUM = (0.80, 0.42, 0.42)
TOOTH = (0.95, 0.905, 0.845)
TOOTH_GAP = (0.82, 0.74, 0.67)
TONGUE = (0.93, 0.52, 0.52)
EYE_WHITE = (0.965, 0.95, 0.94)
EYE_CORNER = (0.88, 0.55, 0.52)
IRIS_LIGHT = (0.50, 0.66, 0.52)
IRIS_DARK = (0.16, 0.30, 0.27)
IRIS_RIM = (0.09, 0.15, 0.15)
PUPIL = (0.03, 0.03, 0.035)
LASH = (0.14, 0.08, 0.07)
BROW = (0.40, 0.235, 0.16)
HAIR = (0.43, 0.235, 0.145)
HAIR_LIGHT = (0.60, 0.35, 0.21)
HAIR_DEEP = (0.25, 0.125, 0.085)
CLOTH = (0.16, 0.44, 0.47)
CLOTH_RIB = (0.13, 0.38, 0.41)
EARRING = (0.95, 0.80, 0.50)

SKIN_FINISH = Finish((0.48, 0.28, 0.20), gloss=0.13, focus=4, edge=0.22)
LIP_FINISH = Finish((0.40, 0.24, 0.20), gloss=0.34, focus=5, edge=0.12)
MOUTH_FINISH = Finish((0.3, 0.2, 0.2))
TOOTH_FINISH = Finish((0.5, 0.45, 0.4), gloss=0.14, focus=6, edge=0.02)
TONGUE_FINISH = Finish((0.5, 0.3, 0.3), gloss=0.22, focus=5)
EYE_FINISH = Finish((0.5, 0.42, 0.38), gloss=0.1, focus=6, edge=0.05)
GLOWING = Finish((1.0, 1.0, 1.0))
BROW_FINISH = Finish((0.3, 0.25, 0.2), gloss=0.05, focus=3)
HAIR_FINISH = Finish((0.32, 0.26, 0.22), gloss=0.20, focus=5, edge=0.05, strands=True)
CLOTH_FINISH = Finish((0.3, 0.3, 0.3), edge=0.18)
METAL_FINISH = Finish((0.2, 0.2, 0.2), gloss=0.9, focus=5, edge=0.3)

FINISHES = (
    SKIN_FINISH, LIP_FINISH, MOUTH_FINISH, TOOTH_FINISH, TONGUE_FINISH, EYE_FINISH, GLOWING, BROW_FINISH, HAIR_FINISH,
    CLOTH_FINISH, METAL_FINISH,
)  # fmt: skip
