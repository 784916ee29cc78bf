"""How strongly one sentence moves different heads: gap, width and protrusion of the lips in millimetres.

    python benchmarks/strength.py HEAD... [--speech FILE --transcript FILE] [--sheet FILE.png] [--json FILE.json]

HEAD : a character, with the table beside it if there is one (docs/meshes.md)

The motion is what the shipped model generates for the speech (default: the example). Millimetres: the unit of each head
is the power of ten of a metre in which it is 0.1 to 1 m high, as heads of files are metres, decimetres or centimetres.
Measured on the mesh's own lip points, against the mesh at rest: the gap of the middles of the inner lips (98th
percentile; median in the middles of aa, ae, ah, ay), the width in the middles of uw, w, ow and of iy, ih (median, and
in parts of the mouth's width at rest), and how far the outer lips come forward in uw, w, ow. The sheet shows a row for
each head: at rest, widest open, and in the middles of the last m, iy and uw.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion.articulation.lip_points import (
    CHIN,
    LEFT_CORNER,
    LOWER_EDGE,
    LOWER_MIDDLE,
    RIGHT_CORNER,
    UPPER_EDGE,
    UPPER_MIDDLE,
)
from lipmotion.meshes.fitting.driven import DrivenCharacter, driven_character
from lipmotion.units import LIP_CLOSING
from lipmotion_faces.mesh import MeshStage

EXAMPLES = Path(__file__).parents[1] / "examples"
OPEN, ROUND, SPREAD = ("aa", "ae", "ah", "ay"), ("uw", "w", "ow"), ("iy", "ih")
POINTS = (UPPER_MIDDLE, LOWER_MIDDLE, RIGHT_CORNER, LEFT_CORNER, UPPER_EDGE, LOWER_EDGE)
Array = NDArray[np.float64]


def middles(spoken: lipmotion.Generation, phones: tuple[str, ...]) -> list[int]:
    """The frames in the middles of phones."""
    spans = [span for span in spoken.units if span.label.phone in phones]
    return [round((span.start_s + span.end_s) / 2 * spoken.motion.rate_hz) for span in spans]


def millimetres(character: DrivenCharacter) -> float:
    """Millimetres in a unit of the mesh."""
    mesh, placement = character.mesh, character.placement
    height = float((mesh.vertices @ placement.axes[:, 1]).max())
    height -= float(mesh.vertices[placement.vertices[placement.row(CHIN)]] @ placement.axes[:, 1])
    return float(1000 / 10 ** np.ceil(np.log10(height)))


def measured(character: DrivenCharacter, spoken: lipmotion.Generation) -> dict[str, Any]:
    """What is measured of one head."""
    motion, units, placement = spoken.motion, spoken.units, character.placement
    rows = placement.vertices[[placement.row(point) for point in POINTS]]
    places = np.stack([vertices[rows] for vertices in character.vertices(motion, units, motion.time_s)])
    scale = millimetres(character)
    places, rest = scale * places @ placement.axes, scale * character.mesh.vertices[rows] @ placement.axes
    moved = places - rest
    gap = moved[:, 0, 1] - moved[:, 1, 1]
    at_rest = float(np.linalg.norm(rest[3] - rest[2]))
    wider = np.linalg.norm(places[:, 3] - places[:, 2], axis=1) - at_rest
    forward = moved[:, 4:, 2].mean(axis=1)
    closed = [span for span in units if span.label.phone in LIP_CLOSING]
    least = [gap[round(span.start_s * 100) : round(span.end_s * 100) + 1].min() for span in closed]
    ends, round_, spread = (middles(spoken, phones) for phones in (OPEN, ROUND, SPREAD))
    return {
        "by": character.shapes.style if character.shapes else "control points",
        "width at rest": at_rest,
        "gap, 98th percentile": float(np.percentile(gap, 98)),
        "gap in aa": float(np.median(gap[ends])),
        "width in oo": float(np.median(wider[round_])),
        "width in oo, of that at rest": 1 + float(np.median(wider[round_])) / at_rest,
        "forward in oo": float(np.median(forward[round_])),
        "width in ee": float(np.median(wider[spread])),
        "largest gap of a closure": float(max(least)),
    }


def pictures(character: DrivenCharacter, spoken: lipmotion.Generation, size: int = 220) -> NDArray[np.uint8]:
    """Pictures of a head beside one another [shape=(H, W, 3)]."""
    motion, units = spoken.motion, spoken.units
    vertices = list(character.vertices(motion, units, motion.time_s))
    widest = int(np.argmax(motion["opening"]))
    frames = [widest, *(middles(spoken, (phone,))[-1] for phone in ("m", "iy", "uw"))]
    stage = MeshStage(character, size, size)
    return np.hstack([stage.picture(each) for each in (character.mesh.vertices, *(vertices[n] for n in frames))])


def main() -> None:
    """Print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("heads", nargs="+", type=Path)
    parser.add_argument("--speech", type=Path, default=EXAMPLES / "welcome.flac")
    parser.add_argument("--transcript", type=Path, default=EXAMPLES / "welcome.txt")
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    spoken = lipmotion.animate(options.speech, transcript=options.transcript)
    characters = {path.name: driven_character(path) for path in options.heads}
    figures = {
        name: {key: value if isinstance(value, str) else round(value, 2) for key, value in row.items()}
        for name, row in ((name, measured(character, spoken)) for name, character in characters.items())
    }
    if options.sheet:
        from PIL import Image

        rows = [pictures(character, spoken) for character in characters.values()]
        Image.fromarray(np.vstack(rows)).save(options.sheet, quality=88, optimize=True)
    text = json.dumps(figures, indent=1)
    if options.json:
        options.json.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
