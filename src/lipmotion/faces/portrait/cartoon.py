"""The cartoon: surfaces of one colour, lines around them, large eyes; in the style of two-dimensional rigs."""

from __future__ import annotations

from lipmotion.faces.portrait.design import Design, EyeDesign, LipDesign, Lock
from lipmotion.faces.portrait.outlines import closed_curve
from lipmotion.faces.portrait.palette import Palette

CARTOON = Design(
    palette=Palette(
        wall=(255, 214, 120),
        wall_light=(255, 224, 150),
        skin=(255, 205, 160),
        skin_light=(255, 222, 186),
        skin_shade=(240, 172, 124),
        skin_deep=(214, 138, 96),
        blush=(252, 160, 130),
        hair=(232, 98, 58),
        hair_dark=(176, 62, 40),
        hair_light=(250, 142, 84),
        lashes=(58, 32, 40),
        cloth=(60, 132, 196),
        cloth_light=(90, 160, 220),
        cloth_dark=(40, 96, 156),
        eye_white=(255, 255, 255),
        iris=(70, 120, 90),
        iris_dark=(58, 32, 40),
        pupil=(40, 24, 32),
        upper_lip_light=(240, 160, 122),
        upper_lip_dark=(240, 160, 122),
        lower_lip_light=(243, 166, 128),
        lower_lip_dark=(243, 166, 128),
        seam=(58, 32, 40),
        cavity=(98, 24, 40),
        tooth=(255, 255, 255),
        lower_tooth=(244, 240, 236),
        tongue=(240, 108, 112),
        line=(58, 32, 40),
    ),
    head="0 -0.95, 0.42 -0.88, 0.74 -0.58, 0.85 -0.1, 0.85 0.35, 0.83 0.72, 0.7 1.06, 0.42 1.28, 0.18 1.36, 0 1.37",
    neck=closed_curve(
        "-0.3 0.7, -0.3 1.2, -0.31 1.5, -0.5 1.74, -1.0 1.9, -1.0 2.6, 1.0 2.6, 1.0 1.9, 0.5 1.74, 0.31 1.5,"
        "0.3 1.2, 0.3 0.7"
    ),
    shoulders=closed_curve(
        "-0.46 1.7, -0.8 1.78, -1.15 1.92, -1.4 2.2, -1.5 2.8, 1.5 2.8, 1.4 2.2, 1.15 1.92, 0.8 1.78, 0.46 1.7,"
        "0.3 1.86, 0.14 1.95, 0 1.98, -0.14 1.95, -0.3 1.86"
    ),
    lips=LipDesign(line_y=0.9, half_width=0.3, upper=0.036, lower=0.05, seam=0.012, smile=-0.058, outline=0.024),
    eyes=EyeDesign(
        x=0.35,
        y=0.0,
        iris=0.12,
        upper=((0.15, 0.025), (0.22, -0.076), (0.35, -0.114), (0.48, -0.08), (0.555, 0.015)),
        lower=((0.15, 0.025), (0.23, 0.09), (0.35, 0.11), (0.47, 0.085), (0.555, 0.015)),
        lashes=1.05,
        brow="0.165 -0.345, 0.3 -0.376, 0.45 -0.374, 0.585 -0.322",
        brow_widths=(0.026, 0.05, 0.054, 0.044, 0.022),
    ),
    ear="0.8 0.1, 0.9 0.0, 1.0 0.06, 0.99 0.26, 0.92 0.4, 0.82 0.42",
    ear_hollow="0.88 0.14, 0.93 0.1, 0.95 0.17, 0.93 0.27, 0.88 0.32",
    hair=(
        Lock(
            closed_curve(
                "-0.86 0.02, -0.93 -0.36, -0.86 -0.74, -0.62 -1.04, -0.36 -1.12, -0.2 -1.3, 0.08 -1.36, 0.3 -1.22,"
                "0.56 -1.14, 0.84 -0.84, 0.93 -0.4, 0.86 0.02, 0.8 -0.24, 0.66 -0.5, 0.5 -0.62, 0.3 -0.54, 0.06 -0.64,"
                "-0.2 -0.52, -0.44 -0.6, -0.66 -0.48, -0.8 -0.24"
            ),
            None,
            ("-0.3 -0.98, -0.12 -1.12, 0.1 -1.16, 0.26 -1.1", "0.4 -0.98, 0.56 -0.9, 0.68 -0.74, 0.74 -0.56"),
        ),
    ),
    blush=0.55,
    line=0.026,
)
