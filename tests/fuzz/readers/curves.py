"""Motion that is supplied beside recordings: tables, documents, plain arrays."""

import io
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.examples import of_motion, written
from fuzz.inputs import Files, Good
from fuzz.plausible import require, short_speech
from lipmotion import Corpus, CueSheet
from lipmotion.formats.c3d import C3dFile, write_c3d
from lipmotion.formats.cues import CUE_FORMATS
from lipmotion.types import WEIGHT, Channel, Motion, Span, Timeline
from lipmotion.units.phones import SHAPES
from lipmotion_faces.corpus.captured_faces import read_channels
from lipmotion_faces.corpus.source_recordings import MotionFile
from lipmotion_faces.corpus.supplied import read_supplied_track
from meshes import gltf
from meshes.flame import head
from meshes.live_link_app import write_take
from robustness.case import npy
from robustness.motion_cases import GOOD

NAMES, VALUES = "x_bs_name.npy", "bs_value_a.npy"
FRAMES, RATE_HZ = 23, 30.0
"""As long as the short speech."""


def seeds(_: Good) -> list[Files]:
    """Return the same motion in every format."""
    values = np.linspace(0, 0.3, 2 * FRAMES).reshape(FRAMES, 2)
    channels = [{"name": name, "unit": WEIGHT} for name in ("opening", "width")]
    document = GOOD | {"rate_hz": RATE_HZ, "channels": channels, "values": values.tolist()}
    rows = [f"{n / RATE_HZ:.9f},{first},{second}" for n, (first, second) in enumerate(values)]
    archive = io.BytesIO()
    np.savez(archive, values=values, document=np.array(json.dumps(document | {"values": None})))
    return [
        *_captures(),
        {"a.csv": "\n".join(["time_s,opening,width", *rows]).encode()},
        {"a.json": json.dumps(document).encode()},
        {"a.npz": archive.getvalue()},
        {"a.jsonl": _azure(values)},
        {"d.csv": "\n".join(["frame;timestamp_ms;jawOpen", *(f"{n};{33 * n};0,1" for n in range(FRAMES))]).encode()},
        {"a.000001.ply": head(5, "<")},
        {VALUES: npy(values), NAMES: npy(np.array(["opening", "width"]))},
    ]


def _azure(values: NDArray[np.float64]) -> bytes:
    """Return frames of 55 weights as events of Azure's voices, one a line."""
    halves = [{"FrameIndex": n, "BlendShapes": np.tile(values[n : n + 12, :1], 55).tolist()} for n in (0, 12)]
    return "\n".join(json.dumps({"AudioOffset": 0, "Animation": json.dumps(half)}) for half in halves).encode()


def _captures() -> list[Files]:
    """Return the same second of motion as programs of motion capture write it."""
    values = np.linspace(0, 0.3, 3 * FRAMES).reshape(FRAMES, 3)
    names = ("x_13", "y_13", "z_13")
    moving = of_motion(Motion(values, RATE_HZ, tuple(map(Channel, names))))
    weights = Motion(values[:, :1], RATE_HZ, (Channel("jawOpen", WEIGHT),))
    fap = (Channel("fap3_open_jaw", "fap"), Channel("fap4", "fap"))
    parameters = of_motion(Motion(np.rint(900 * values[:, :2]), RATE_HZ, fap))
    markers = C3dFile(("EYE_L", "EYE_R", "chin"), np.stack([values + 45, values - 45, 2 * values], axis=1), RATE_HZ)
    cues = Timeline((Span(0.0, 0.3, "X"), Span(0.3, 0.5, "A"), Span(0.5, 0.75, "E")))
    frames_s = [n / RATE_HZ for n in range(FRAMES)]
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name, form in CUE_FORMATS.items():
            sheet = CueSheet(cues, 24.0, "".join(SHAPES), Timeline((Span(0.3, 0.7, "moth"),)))
            if form.parse:
                (folder / f"c.{name}").write_text(form.text(sheet, "c.wav"), encoding="utf-8")
        (folder / "a.glb").write_bytes(gltf.glb(*gltf.animated_document(frames_s, values[:, :2])))
        expression = {"node": 1, "path": "translation"}
        (folder / "a.vrma").write_bytes(gltf.glb(*gltf.animated_document(frames_s, values, target=expression)))
        write_take(folder / "a.csv", weights)
        written(folder / "a.c3d", moving)
        write_c3d(folder / "b.c3d", markers)
        written(folder / "a.fap", parameters)
        vowels = (Channel("aa", WEIGHT), Channel("eyeBlinkLeft", WEIGHT), Channel("eyeBlinkRight", WEIGHT))
        written(folder / "a.vmd", of_motion(Motion(values, RATE_HZ, vowels)))
        written(folder / "a.a2f.json", of_motion(weights))
        rows = [f"{1000 * n / RATE_HZ:.1f},{row[0]}" for n, row in enumerate(values)]
        (folder / "c.csv").write_text("\n".join(["time_ms,jawOpen", *rows]))
        return [{path.name: path.read_bytes()} for path in sorted(folder.iterdir())]


def read(folder: Path, good: Good) -> None:
    """Read motion; store it in a corpus, and read it again from there."""
    names = folder / NAMES
    path = folder / VALUES if names.exists() else next(folder.iterdir())
    rate_hz = RATE_HZ / FRAMES if path.suffix == ".ply" else RATE_HZ  # one mesh is all of the motion
    curves = MotionFile(path, rate_hz, read_channels(names) if names.exists() else ())
    track = read_supplied_track(curves, short_speech(good).duration_s)
    require(bool(np.isfinite(track.motion.values).all()), "values that are not finite")
    corpus = Corpus.open(good.corpus)
    utterance = replace(corpus.utterance(corpus.names()[0]), track=track)
    with tempfile.TemporaryDirectory() as kept:
        Corpus.create(Path(kept) / "c").add(utterance)
        Corpus.open(Path(kept) / "c").utterance(utterance.name)
