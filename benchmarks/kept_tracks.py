"""Tracks of videos, kept in a folder: tracking takes longer than all that is measured with it."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import numpy as np

from lipmotion.types import Channel, Motion, Track
from lipmotion_faces.tracking.track import track


def kept_track(path: Path, folder: Path | None) -> Track:
    """Return the track of a video, without pictures.

    folder : where tracks are kept, by the content of the video; it is made if need be. None: tracked anew
    """
    if folder is None:
        return track(path, crops=False)
    kept = folder / f"{path.stem}-{sha256(path.read_bytes()).hexdigest()[:12]}.npz"
    if not kept.exists():
        found = track(path, crops=False)
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(
            kept, values=found.motion.values, rate_hz=found.motion.rate_hz, names=found.motion.names, seen=found.seen
        )
    with np.load(kept) as arrays:
        channels = tuple(Channel(str(name)) for name in arrays["names"])
        return Track(Motion(arrays["values"], float(arrays["rate_hz"]), channels), arrays["seen"])
