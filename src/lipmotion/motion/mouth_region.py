"""The region of a face that mouth pictures show, in pixels of a head that is upright and faces the camera."""

from __future__ import annotations

WIDTH, HEIGHT = 72, 56  # size of a mouth picture, px
CORNER = (-36.0, 48.0)  # upper left corner of the region, in px from the point between the eyes, y down
EYE_DISTANCE_PX = 90.0  # distance between the outer eye corners, px
