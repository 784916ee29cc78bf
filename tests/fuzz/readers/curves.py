"""Motion that is supplied beside recordings: tables, documents, plain arrays."""

from __future__ import annotations

import io
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import require, short_speech
from lipmotion.corpora.facegood import read_channels
from lipmotion.corpora.source_recordings import MotionFile
from lipmotion.corpora.store import Corpus
from lipmotion.pipeline.corpus.supplied_motion import supplied_track
from lipmotion.types import WEIGHT
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
        {"a.csv": "\n".join(["time_s,opening,width", *rows]).encode()},
        {"a.json": json.dumps(document).encode()},
        {"a.npz": archive.getvalue()},
        {VALUES: npy(values), NAMES: npy(np.array(["opening", "width"]))},
    ]


def read(folder: Path, good: Good) -> None:
    """Read motion; store it in a corpus, and read it again from there."""
    names = folder / NAMES
    path = folder / VALUES if names.exists() else next(folder.iterdir())
    curves = MotionFile(path, RATE_HZ, read_channels(names)) if names.exists() else MotionFile(path)
    track = supplied_track(curves, short_speech(good).duration_s)
    require(bool(np.isfinite(track.motion.values).all()), "values that are not finite")
    corpus = Corpus.open(good.corpus)
    utterance = replace(corpus.utterance(corpus.names()[0]), track=track)
    with tempfile.TemporaryDirectory() as kept:
        Corpus.create(Path(kept) / "c").add(utterance)
        Corpus.open(Path(kept) / "c").utterance(utterance.name)
