"""The face-mesh points (of 478) that are used, and why.

Left and right are the speaker's own; in the picture the speaker's left is on the right.
"""

from __future__ import annotations

EYE_CORNERS = (33, 263)
"""Outer corners, right and left: the unit of length and the x axis."""

LIP_POINTS = (
    # outer edge, from the right corner over the lower lip to the left corner and back over the upper lip
    *(61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291, 409, 270, 269, 267, 0, 37, 39, 40, 185),
    # inner edge, the same way round
    *(78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308, 415, 310, 311, 312, 13, 82, 81, 80, 191),
)
"""All 40 lip points of the face mesh."""

JAW_POINTS = (
    # chin: its tip, and the soft part between it and the lower lip
    *(152, 175, 199, 200),
    # jaw line from the chin outwards, right and left in turn
    *(148, 377, 176, 400, 149, 378, 150, 379),
)
"""Chin and jaw line."""

RIGID_POINTS = (
    # forehead: skin over bone, above the brows (which rise and fall with emphasis)
    *(10, 151, 9, 109, 338, 67, 297, 103, 332),
    # temples: beside the eyes and above; lower down the cheeks follow the jaw
    *(54, 284, 21, 251, 162, 389, 127, 356),
    # bridge of the nose: bone and cartilage; the tip and the wings are moved by the upper lip
    *(168, 6, 197, 195),
    # eye corners: fixed by ligaments, while the lids blink
    *(33, 133, 362, 263),
)
"""Points that do not move with speech; the head pose is estimated from them."""

FOREHEAD, NASION = 10, 168
"""Top of the forehead, and bridge of the nose between the eyes; they give the upright direction."""

FOREHEAD_SLOPE_DEG = 8.6
"""Slope of the line from NASION to FOREHEAD, backwards, in MediaPipe's canonical face, which looks straight ahead."""

DISTANCES = {"opening": (13, 14), "width": (61, 291), "outer": (0, 17)}
"""The three distances as pairs of points: between the inner lips, the lip corners, the outer lips."""

TRACKED_POINTS = tuple(sorted({*LIP_POINTS, *JAW_POINTS, *RIGID_POINTS}))
"""Every point that is kept from a frame."""
