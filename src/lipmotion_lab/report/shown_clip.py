"""One held-out recording of an experiment: as recorded, and as every system moves it; its curves and its videos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.Image import Resampling

from lipmotion.corpora.store import Corpus
from lipmotion.formats.web_page import Html
from lipmotion.motion.mouth_region import HEIGHT, WIDTH
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.types import Audio, Channel, Monitor, Motion, Span, Timeline, Unit, with_progress
from lipmotion_faces import Staging, stage_face
from lipmotion_faces.video.mp4 import SOUND_HZ, write_mp4
from lipmotion_lab.evaluation.evaluate import BILABIAL
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, DISTANCES, OPENING, ComparedClip, HeldOutRecordings
from lipmotion_lab.report.charts import draw_curve

FPS = 25.0
MOUTH_SCALE = 4
"""Mouth pictures of a corpus are shown so many times as large."""
STAGING = Staging(size=640, blinks=False, gaze=False, brows=False, head=False)
"""Only the mouth moves, so that nothing else differs between systems."""
LOWER_FACE = (slice(340, 340 + MOUTH_SCALE * HEIGHT), slice(176, 176 + MOUTH_SCALE * WIDTH))
"""The part of the drawn picture that is shown, as large as a filmed mouth."""
DECIMALS = 5
RECORDED = "recorded"


@dataclass(frozen=True)
class ClipKeeper:
    """Receives what systems generate for held-out recordings, sound alone, and keeps that of one recording in a file.

    path : of the file, which is written anew at every call, so that a run that was stopped goes on
    key  : of the run: what an earlier run with another key left is replaced
    The recording is the one with most p, b and m, whatever the systems make of it; among equals the first.
    """

    path: Path
    key: str

    def __call__(
        self, system: str, condition: str, recordings: HeldOutRecordings, clips: Sequence[ComparedClip]
    ) -> None:
        """Keep the motion of a system."""
        if condition != AUDIO_ONLY:
            return

        def rounded(values: NDArray[np.float64]) -> Any:
            return np.round(values, DECIMALS).tolist()

        closings = [sum(phone in BILABIAL for *_, phone in clip.spoken) for clip in clips]
        number = int(np.argmax(closings))
        clip, utterance = clips[number], recordings.utterances[number]
        columns = [recordings.channels.index(name) for name in DISTANCES if name in recordings.channels]
        content = self.content()
        if content.get("name") != utterance.name or not content["systems"]:
            content = {"key": self.key, "name": utterance.name, "words": list(utterance.words or ()), "systems": {}}
            content |= {"channels": [recordings.channels[column] for column in columns], "spoken": clip.spoken}
            content |= {"time_s": rounded(clip.time_s), RECORDED: rounded(clip.original[:, columns])}
        content["systems"][system] = rounded(clip.generated[:, columns])
        with atomic_file(self.path) as unfinished:
            unfinished.write_text(as_json(content) + "\n", encoding="utf-8")

    def content(self) -> dict[str, Any]:
        """Return what is kept; empty: nothing of this run."""
        try:
            content = from_json(self.path.read_bytes())
            return dict(content) if content["key"] == self.key else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}


def draw_curves(content: Mapping[str, Any], systems: Sequence[str]) -> list[Html]:
    """Return a chart of the opening for each of some systems, with the p, b and m of the recording."""
    column, time_s = content["channels"].index(OPENING), np.array(content["time_s"])
    recorded = np.array(content[RECORDED])[:, column]
    marked = [tuple(span) for span in content["spoken"] if span[2] in BILABIAL]
    return [
        draw_curve(name, time_s, recorded, np.array(content["systems"][name])[:, column], marked)
        for name in systems
        if name in content["systems"]
    ]


def write_videos(
    content: Mapping[str, Any], systems: Sequence[str], corpus: Corpus, folder: Path, monitor: Monitor
) -> list[dict[str, str]]:
    """Write a video with sound for the recording and for each of some systems; return their files and captions.

    The mouth as it was filmed is shown where the corpus has its pictures; else, and for every system, a drawn face.
    Raises ExportError: a video cannot be written.
    """
    from scipy.signal import resample_poly

    utterance = corpus.utterance(content["name"])
    samples = resample_poly(np.asarray(utterance.audio.samples, np.float32), SOUND_HZ, utterance.audio.rate_hz)
    sound, found = Audio(samples.astype(np.float32), SOUND_HZ), []
    crops = utterance.track.crops
    if crops is not None and len(crops):
        size = (MOUTH_SCALE * crops.shape[2], MOUTH_SCALE * crops.shape[1])
        enlarged = (np.asarray(Image.fromarray(np.asarray(crop)).resize(size, Resampling.BICUBIC)) for crop in crops)
        write_mp4(folder / "mouth.mp4", enlarged, fps=utterance.track.motion.rate_hz, audio=sound)
        found.append({"file": "mouth.mp4", "caption": "the recording itself: the mouth as filmed"})
    shown = {RECORDED: content[RECORDED]}
    shown |= {name: content["systems"][name] for name in systems if name in content["systems"]}
    # No shape of a phone is drawn, the motion alone is shown: the face is given the silence around the phones.
    spoken_s = (time_s for start_s, end_s, _ in content["spoken"] for time_s in (start_s, end_s))
    edges = [0.0, *spoken_s, utterance.audio.duration_s]
    gaps = [(start, end) for start, end in zip(edges[::2], edges[1::2], strict=True) if end - start > 1 / FPS]
    silence = Timeline(tuple(Span(start, end, Unit("sil")) for start, end in gaps))
    for number, name in enumerate(with_progress(list(shown), "videos", monitor)):
        values = np.array(shown[name])
        time_s = np.arange(int(utterance.audio.duration_s * FPS) + 1) / FPS
        columns = [np.interp(time_s, content["time_s"], column) for column in values.T]
        motion = Motion(np.stack(columns, axis=1), FPS, tuple(map(Channel, content["channels"])))
        file = f"{number}.mp4"
        frames = (picture[LOWER_FACE] for picture in stage_face("woman", STAGING).render(motion, silence, fps=FPS))
        write_mp4(folder / file, frames, fps=FPS, audio=sound)
        found.append({"file": file, "caption": "a drawn face, recorded motion" if name == RECORDED else name})
    return found
