"""Drawings in layers, and folders of drawings, as characters of the user's own."""

import tempfile
from pathlib import Path

import numpy as np

from faces.test_cut_out import draw
from fuzz.inputs import Files, Good
from fuzz.plausible import require
from lipmotion.types import Channel, Motion, Timeline
from lipmotion_faces import Staging, stage_face
from lipmotion_faces.cut_out import read_cut_out

ROBOT = Path(__file__).parents[3] / "examples" / "robot.svg"
SMALL = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 40"><g id="head" transform="rotate(5) scale(1.1 1)">
<path d="M5 5C8 2 30 2 35 9S30 30 20 35Q5 30 4 20T5 5A9 6 30 0 1 9 9zm4 4h9v-3l2 2" fill="#fa8" stroke="navy"/>
<g id="mouth-rest" style="fill:none;stroke:rgb(9,9,9);stroke-width:2"><line x1="10" y1="25" x2="30" y2="25"/></g>
<g id="mouth-aa" opacity=".9"><ellipse cx="20" cy="25" rx="8" ry="6" fill-opacity="0.8"/></g>
<g id="eyes-open"><circle cx="12" cy="12" r="3"/><polygon points="25,10 31,10 28,15" fill-rule="evenodd"/></g></g></svg>
"""


def seeds(_: Good) -> list[Files]:
    """Return the example, a small drawing with every kind of shape, and a picture of every mouth shape."""
    with tempfile.TemporaryDirectory() as folder:
        charts = draw(Path(folder), "A B C D E F G H X")
        chart = {path.name: path.read_bytes() for path in sorted(charts.iterdir())}
    return [{"face.svg": ROBOT.read_bytes()}, {"face.svg": SMALL.encode()}, chart]


def read(folder: Path, _: Good) -> None:
    """Read a drawing; draw two frames."""
    if not (folder / "face.svg").exists():
        for frame in read_cut_out(folder).draw("A", Staging(size=64)):
            require(frame.shape[0] == 64 and frame.shape[2] == 3, "a frame of another shape")
        return
    motion = Motion(np.array([[0.0], [0.2]]), 25.0, (Channel("opening"),))
    for frame in stage_face(str(folder / "face.svg"), Staging(size=64)).render(motion, Timeline(()), fps=25.0):
        require(frame.ndim == 3 and frame.shape[0] == 64 and frame.shape[2] == 3, "a frame of another shape")
