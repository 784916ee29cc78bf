"""The woman: the portrait of the first version."""

from __future__ import annotations

from lipmotion.faces.portrait.design import Design, LipDesign, Lock
from lipmotion.faces.portrait.outlines import closed_curve, symmetric
from lipmotion.faces.portrait.palette import Palette

WOMAN = Design(
    palette=Palette(),
    head="0 -0.93, 0.36 -0.86, 0.63 -0.6, 0.745 -0.2, 0.755 0.2, 0.725 0.55, 0.635 0.9, 0.45 1.19, 0.22 1.35, 0 1.39",
    neck=closed_curve(
        "-0.35 0.7, -0.35 1.2, -0.37 1.48, -0.6 1.72, -1.1 1.86, -1.1 2.6, 1.1 2.6, 1.1 1.86, 0.6 1.72, 0.37 1.48,"
        "0.35 1.2, 0.35 0.7"
    ),
    shoulders=closed_curve(
        "-0.58 1.66, -0.9 1.74, -1.3 1.86, -1.62 2.1, -1.7 2.6, 1.7 2.6, 1.62 2.1, 1.3 1.86, 0.9 1.74, 0.58 1.66,"
        "0.42 1.85, 0.2 2, 0 2.04, -0.2 2, -0.42 1.85"
    ),
    hair_behind=symmetric(
        "0 -1.06, 0.5 -0.98, 0.83 -0.62, 0.92 -0.1, 0.93 0.4, 0.99 0.9, 1.08 1.35, 1 1.7, 0.7 1.9, 0.3 1.85, 0 1.8"
    ),
    hair=(
        Lock(
            closed_curve(
                "-0.2 -0.98, -0.34 -1.05, -0.58 -0.97, -0.8 -0.72, -0.875 -0.3, -0.835 0.04, -0.765 0.25, -0.73 0.02,"
                "-0.68 -0.24, -0.52 -0.48, -0.32 -0.64, -0.22 -0.76"
            ),
            (-0.52, -0.76, 0.25, 0.1),
        ),
        Lock(
            closed_curve(
                "-0.24 -0.96, -0.1 -1.06, 0.2 -1.11, 0.58 -1, 0.82 -0.7, 0.885 -0.28, 0.84 0.04, 0.77 0.25, 0.735 0.03,"
                "0.69 -0.2, 0.54 -0.39, 0.24 -0.5, -0.04 -0.63, -0.2 -0.78"
            ),
            (0.3, -0.76, 0.25, 0.1),
            tuple(
                f"-0.19 {-0.8 - 0.6 * lift}, 0.12 {-0.7 - lift}, 0.48 {-0.56 - lift}, 0.76 {-0.16 - 1.2 * lift}"
                for lift in (0.05, 0.15, 0.24)
            ),
        ),
    ),
    lips=LipDesign(smile=-0.048),
    earrings=True,
    collarbones=True,
)
