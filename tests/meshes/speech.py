"""Motion of a made-up sentence with known closures: silence, m, aa, p, uw, silence."""

import numpy as np

from lipmotion.articulation.lip_points import build_mouth
from lipmotion.types import Channel, Motion, Span, Timeline, Unit

PHONES = (("sil", 0.0, 0.5), ("m", 0.5, 0.6), ("aa", 0.6, 0.9), ("p", 0.9, 1.0), ("uw", 1.0, 1.3), ("sil", 1.3, 2.0))
OPENINGS = (0.005, 0.0, 0.2, 0.0, 0.06, 0.005)
JAWS = (0.0, 0.03, 0.15, 0.08, 0.05, 0.0)  # how far the chin is down: in p the jaw is still open behind closed lips
WIDTHS = (0.59, 0.58, 0.60, 0.57, 0.50, 0.59)


def said(*spans: tuple[float, float, str]) -> Timeline[Unit]:
    return Timeline(tuple(Span(start, end, Unit(phone)) for start, end, phone in spans))


def units() -> Timeline[Unit]:
    return said(*((start, end, phone) for phone, start, end in PHONES))


def motion(*, points: bool = True, rate_hz: float = 100.0) -> Motion:
    time_s = np.arange(int(2.0 * rate_hz) + 1) / rate_hz
    middles = [start + share * (end - start) for _, start, end in PHONES for share in (0.3, 0.5, 0.7)]
    opening, width, jaw = (np.interp(time_s, middles, np.repeat(values, 3)) for values in (OPENINGS, WIDTHS, JAWS))
    channels = [Channel("opening"), Channel("width")]
    columns = [opening, width]
    if points:
        template = build_mouth()
        rest = template.places
        half = template.width / 2
        middle = np.sqrt(1 - np.clip(rest[:, 0] / half, -1, 1) ** 2)
        for row, point in enumerate(template.points):
            x = rest[row, 0] * (width / width[0] if not template.jaw[row] else 1.0)
            share = 0.2 * template.upper[row] * middle[row] - 0.8 * template.lower[row] * middle[row]
            drop = -jaw if template.jaw[row] else share * opening
            columns += [x + 0 * time_s, rest[row, 1] + drop, rest[row, 2] + 0 * time_s]
            channels += [Channel(f"{axis}_{point}") for axis in "xyz"]
    return Motion(np.stack(columns, axis=1), rate_hz, tuple(channels))
