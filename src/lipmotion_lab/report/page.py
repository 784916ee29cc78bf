"""The page of a report: what was found first, then every experiment with its words, tables, pictures and videos."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.Image import Resampling

from lipmotion.corpora import Corpus
from lipmotion.motion.eigenlips import MOUTH_HEIGHT, MOUTH_WIDTH
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.types import Audio, Channel, Monitor, Motion, Span, Timeline, Unit, with_progress
from lipmotion_faces import Staging, stage_face
from lipmotion_faces.video.mp4 import SOUND_HZ, write_mp4
from lipmotion_lab.evaluation.evaluate import BILABIAL
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, DISTANCES, ComparedClip, HeldOutRecordings
from lipmotion_lab.report.html import Html, add_caption, build_page, element, joined
from lipmotion_lab.report.section import Section, write_text

FPS = 25.0
MOUTH_SCALE = 4  # mouth pictures of a corpus are enlarged by this factor
STAGING = Staging(size=640, blinks=False, gaze=False, brows=False, head=False)
"""Only the mouth moves, so that nothing else differs between systems."""
LOWER_FACE = (slice(340, 340 + MOUTH_SCALE * MOUTH_HEIGHT), slice(176, 176 + MOUTH_SCALE * MOUTH_WIDTH))
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

        def round_values(values: NDArray[np.float64]) -> Any:
            return np.round(values, DECIMALS).tolist()

        closings = [sum(phone in BILABIAL for *_, phone in clip.spoken) for clip in clips]
        number = int(np.argmax(closings))
        clip, utterance = clips[number], recordings.utterances[number]
        columns = [recordings.channels.index(name) for name in DISTANCES if name in recordings.channels]
        content = self.collect()
        if content.get("name") != utterance.name or not content["systems"]:
            content = {"key": self.key, "name": utterance.name, "words": list(utterance.words or ()), "systems": {}}
            content |= {"channels": [recordings.channels[column] for column in columns], "spoken": clip.spoken}
            content |= {"time_s": round_values(clip.time_s), RECORDED: round_values(clip.original[:, columns])}
        content["systems"][system] = round_values(clip.generated[:, columns])
        write_text(self.path, as_json(content) + "\n")

    def collect(self) -> dict[str, Any]:
        """Return what is kept; empty: nothing of this run."""
        try:
            content = from_json(self.path.read_bytes())
            return dict(content) if content["key"] == self.key else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}


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
    sound, videos = Audio(samples.astype(np.float32), SOUND_HZ), []
    crops = utterance.track.crops
    if crops is not None and len(crops):
        size = (MOUTH_SCALE * crops.shape[2], MOUTH_SCALE * crops.shape[1])
        enlarged = (np.asarray(Image.fromarray(np.asarray(crop)).resize(size, Resampling.BICUBIC)) for crop in crops)
        write_mp4(folder / "mouth.mp4", enlarged, fps=utterance.track.motion.rate_hz, audio=sound)
        videos.append({"file": "mouth.mp4", "caption": "the recording itself: the mouth as filmed"})
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
        file = f"{number}.mp4"
        frames = draw_mouths(np.stack(columns, axis=1), content["channels"], silence)
        write_mp4(folder / file, frames, fps=FPS, audio=sound)
        videos.append({"file": file, "caption": "a drawn face, recorded motion" if name == RECORDED else name})
    return videos


def draw_mouths(
    values: NDArray[np.float64], channels: Sequence[str], silence: Timeline[Unit]
) -> Iterator[NDArray[np.uint8]]:
    """Yield pictures of a drawn face's mouth, ``FPS`` a second, for values of some channels [shape=(T, P)]."""
    motion = Motion(values, FPS, tuple(map(Channel, channels)))
    return (picture[LOWER_FACE] for picture in stage_face("woman", STAGING).render(motion, silence, fps=FPS))


FOLDED = 3  # more tables than these are folded together
QUICK_WARNING = (
    "A quick run: few recordings, small models. It shows that everything runs; what it finds about the papers is worth "
    "little. Run it without --quick for figures."
)
HOW_TO_READ = (
    "How to read it: intervals are 95 % bootstrap intervals over the compared recordings; two systems are compared by "
    "the interval of their difference on the same draws of recordings. A pair of the paper holds where that interval "
    "is on the paper's side of 0, is reversed on the other side, open where 0 is in it. The papers used other speakers "
    "and other measures: orders compare, values do not. Every sentence here follows from the figures below it."
)


@dataclass(frozen=True)
class FinishedPart:
    """An experiment whose figures are there."""

    name: str
    record: Mapping[str, Any]
    section: Section


def write_html(  # noqa: PLR0913
    title: str,
    about: Mapping[str, str],
    finished: Sequence[FinishedPart],
    left_open: Mapping[str, str],
    failed: Mapping[str, str],
    *,
    subtitle: str = "How the systems of three papers, and those of this project, do on a corpus.",
    how_to_read: str = HOW_TO_READ,
    quick: bool = False,
) -> str:
    """Return the page of a report; ``left_open`` and ``failed``: reasons by experiment."""
    style = resources.files(__package__).joinpath("report.css").read_text("utf-8")
    header = element("header", element("h1", title), element("p", subtitle, class_="quiet"))
    entries = [
        element("li", element("strong", element("a", each.section.title, href=f"#{each.name}")), each.section.verdict)
        for each in finished
    ]
    for reasons, look in ((failed, "failed"), (left_open, None)):
        entries += [element("li", element("strong", name), why, class_=look) for name, why in reasons.items()]
    warning = [element("p", QUICK_WARNING, class_="warning")] if quick else []
    overview = element("ul", *entries, class_="overview")
    main = element("main", *warning, overview, element("p", how_to_read, class_="quiet"), *map(_write_part, finished))
    footer = element("footer", element("h2", "The corpus and the run"), _list(about))
    return build_page(title, style, header, main, footer)


def _write_part(part: FinishedPart) -> Html:
    section, heading = part.section, f"{part.name}-heading"
    words = [
        joined(element("h3", title), element("ul", *(element("li", sentence) for sentence in sentences)))
        for title, sentences in section.words.items()
        if sentences
    ]
    more = [
        element("details", element("summary", table.heading or table.caption), table.as_html(part.name))
        for table in section.more
    ]
    if len(more) > FOLDED:
        more = [element("details", element("summary", f"{len(more)} more tables"), *more)]
    pictures, videos = [], []
    for each in part.record["pictures"]:
        source, caption = f"{part.name}/{each['file']}", each["caption"]
        pictures.append(add_caption(element("img", src=source, alt=caption, loading="lazy"), caption))
    for each in part.record.get("videos", ()):
        source, caption = f"{part.name}/{each['file']}", each["caption"]
        video = element("video", controls=True, preload="metadata", src=source, aria_label=caption)
        videos.append(add_caption(video, caption))
    made_with = {
        key: ", ".join(f"{name} {value}" for name, value in content.items() if value is not None)
        if isinstance(content, Mapping)
        else str(content)
        for key, content in part.record["stamp"].items()
        if content is not None
    }
    figures = element("a", "all figures as JSON", href=f"{part.name}/figures.json")
    links = element("p", "Beside this page: ", figures, ".")
    return element(
        "section",
        element("h2", section.title, id=heading),
        element("p", section.about, class_="quiet"),
        element("p", section.verdict, class_="verdict"),
        *words,
        section.table.as_html(part.name),
        *more,
        *([element("h3", part.record["clip"]), element("div", *videos, class_="videos")] if videos else []),
        *([element("h3", "Pictures"), element("div", *pictures, class_="pictures")] if pictures else []),
        element("details", element("summary", "How this was made"), _list(made_with), links),
        id=part.name,
        aria_labelledby=heading,
    )


def _list(entries: Mapping[str, str]) -> Html:
    return element("dl", *(joined(element("dt", key), element("dd", text)) for key, text in entries.items()))
