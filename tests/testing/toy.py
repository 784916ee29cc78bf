"""The toy corpus: sentences of a synthesiser, and a drawn face; words, times of phones and motion are known exactly."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.model import HmmConfig
from lipmotion.motion.eigenlips import EYE_DISTANCE_PX, MOUTH_HEIGHT, MOUTH_WIDTH
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.types import Audio, Channel, Motion, Timeline, Track, Unit, Utterance
from lipmotion.units import is_silent
from lipmotion.units.spelling import parse_table
from testing.formant_synthesiser import synthesise

SKIN, LIPS, INSIDE = (206.0, 160.0, 141.0), (172.0, 84.0, 88.0), (58.0, 24.0, 30.0)  # colours, RGB
INNER_WIDTH = 0.8  # width of the inner lips, relative to the width of the mouth
SHADE = 0.15  # share by which the skin is darker at the lower edge of the picture
THINNEST_PX = 0.2


WORDS = {
    word: tuple(phones.split())
    for word, phones in parse_table(
        "baby=b_ey_b_iy blue=b_l_uw bob=b_aa_b five=f_ay_v mama=m_aa_m_ax map=m_ae_p now=n_aw papa=p_aa_p_ax "
        "pop=p_aa_p see=s_iy tea=t_iy two=t_uw"
    ).items()
}
"""The vocabulary, pronounced as in the CMU dictionary."""

_LIP_TARGETS = """
sil sp: 0.00 0.55, p b m: 0.00 0.54, f v: 0.03 0.55, w: 0.05 0.42, uw: 0.07 0.42, uh: 0.10 0.46,
ow: 0.16 0.46 0.08 0.42, ao: 0.20 0.48, oy: 0.18 0.46 0.11 0.59, aa: 0.30 0.55, aw: 0.28 0.56 0.08 0.43,
ay: 0.28 0.56 0.11 0.60, ae: 0.26 0.59, ah: 0.20 0.55, eh: 0.20 0.58, ey: 0.18 0.58 0.10 0.61, ih ix: 0.13 0.58,
iy: 0.09 0.62, ax axr er hh: 0.13 0.54, l el: 0.12 0.55, k g ng: 0.10 0.55, y: 0.08 0.60, r: 0.08 0.50,
sh zh ch jh: 0.08 0.47, t d n en s z th dh: 0.06 0.57, em: 0.10 0.54 0.00 0.54
"""
LIP_TARGETS = {
    phone: tuple(zip(numbers[::2], numbers[1::2], strict=True))
    for phones, _, shape in (row.partition(":") for row in _LIP_TARGETS.split(","))
    for numbers in [tuple(map(float, shape.split()))]
    for phone in phones.split()
}
"""Opening and width (eye distances) of the lips at the start of each phone and, where they differ, at its end."""
LIPS_TOUCH = frozenset({"p", "b", "m"})

CHANNELS = (Channel("opening"), Channel("width"), Channel("outer"))
LIP_THICKNESS = 0.22  # ``outer`` exceeds ``opening`` by this much
LIP_LEAD_S = 0.03  # time by which the lips are ahead of the sound
BLEND_S = 0.12  # time over which neighbouring targets are blended
CLOSING_S = 0.08  # time in which the lips close before p b m, and open after

SPEECH_S = 1.27  # a sentence ends with the word that makes its speech at least this long
SILENCE_S, PITCH_HZ = (0.4, 0.6), (105.0, 135.0)  # ranges

CAMERA_HZ = 25.0
FACE_HEIGHT = 256
_GRID_HZ = 1000
MOTION_HZ = 100.0
SMALL = HmmConfig(mixtures=1, iterations=2)  # phone models that are trained in a second


@dataclass(frozen=True, eq=False)
class ToySentence:
    """One spoken sentence.

    units : the exact times of its phones, each with its word; silence has no word
    split : ``train``, ``val`` or ``test``
    """

    name: str
    words: tuple[str, ...]
    audio: Audio
    units: Timeline[Unit]
    split: str


def toy_sentences(count: int, seed: int = 0) -> list[ToySentence]:
    """Return ``count`` sentences of two to three seconds, with 0.4–0.6 s of silence at both ends of each.

    All words are used before any is used again. The last sixth (at least one) is ``test``, the sixth before it ``val``;
    from six sentences on, ``train`` has every word. A larger count gives the same ones first.
    """
    return list(_speak_sentences(count, seed))


@lru_cache(maxsize=16)
def _speak_sentences(count: int, seed: int) -> tuple[ToySentence, ...]:
    held_out = max(1, count // 6)
    splits = ["train"] * (count - 2 * held_out) + ["val"] * held_out + ["test"] * held_out
    rng = np.random.default_rng(seed)

    def shuffle_words() -> Iterator[str]:
        while True:
            yield from rng.permutation(sorted(WORDS)).tolist()

    vocabulary = shuffle_words()
    return tuple(_speak_sentence(f"toy{number:02d}", split, vocabulary, rng) for number, split in enumerate(splits))


def toy_motion(units: Timeline[Unit], rate_hz: float) -> Motion:
    """Return the lip motion of the toy face: ``opening``, ``width`` and ``outer``, frame n at ``n / rate_hz`` seconds.

    units : phones of the inventory from 0 s on; gaps between them count as silence
    The opening is exactly 0 in p, b and m (``LIP_LEAD_S`` early) and in silence more than 0.1 s away from speech.
    """
    end_s = units.spans[-1].end_s
    margin_s = BLEND_S + LIP_LEAD_S
    grid_s = np.arange(-margin_s, end_s + 2 * margin_s, 1 / _GRID_HZ)
    kernel = np.hanning(round(BLEND_S * _GRID_HZ) + 1)
    separation = np.ones(len(grid_s))
    opening, width = (np.convolve(target, kernel / kernel.sum(), "same") for target in _targets(units, grid_s))
    for span in units:  # the opening is 0 where the lips touch, and goes there on a raised cosine
        if span.label.phone in LIPS_TOUCH:
            away_s = np.maximum(0, np.maximum(span.start_s - grid_s, grid_s - span.end_s))
            separation = np.minimum(separation, 0.5 - 0.5 * np.cos(np.pi * np.minimum(1, away_s / CLOSING_S)))
    opening *= separation
    time_s = np.arange(int(end_s * rate_hz + 1e-9) + 1) / rate_hz + LIP_LEAD_S
    opening, width = np.interp(time_s, grid_s, opening), np.interp(time_s, grid_s, width)
    return Motion(np.stack([opening, width, LIP_THICKNESS + opening], axis=1), rate_hz, CHANNELS)


def toy_utterances(count: int, seed: int = 0) -> list[Utterance]:
    """Return the toy corpus with exact motion, as if every video had been tracked without error at 25 frames a second.

    Calls share their arrays: copy what is to be changed.
    """
    return [_utterance(sentence) for sentence in toy_sentences(count, seed)]


def _speak_sentence(name: str, split: str, vocabulary: Iterator[str], rng: np.random.Generator) -> ToySentence:
    words: list[str] = []
    labels, durations_s = [Unit("sil")], [rng.uniform(*SILENCE_S)]
    while sum(durations_s[1:]) < SPEECH_S:
        words.append(next(vocabulary))
        labels += [Unit(phone, word=words[-1]) for phone in WORDS[words[-1]]]
        usual_s = (0.17 if phone[0] in "aeiou" else 0.105 for phone in WORDS[words[-1]])
        durations_s += [duration_s * rng.uniform(0.85, 1.15) for duration_s in usual_s]
    labels, durations_s = [*labels, Unit("sil")], [*durations_s, rng.uniform(*SILENCE_S)]
    phones = [(label.phone, duration_s) for label, duration_s in zip(labels, durations_s, strict=True)]
    audio, units = synthesise(phones, pitch_hz=rng.uniform(*PITCH_HZ), seed=int(rng.integers(2**31)))
    spans = tuple(replace(span, label=label) for span, label in zip(units, labels, strict=True))
    return ToySentence(name, tuple(words), audio, Timeline(spans), split)


@lru_cache(maxsize=32)
def _utterance(sentence: ToySentence) -> Utterance:
    motion = toy_motion(sentence.units, CAMERA_HZ)
    opening, width, outer = (
        motion[name][:, None, None] * EYE_DISTANCE_PX / 2 for name in ("opening", "width", "outer")
    )
    x = np.arange(MOUTH_WIDTH)[None, None, :] + 0.5 - MOUTH_WIDTH / 2
    y = np.arange(MOUTH_HEIGHT)[None, :, None] + 0.5 - MOUTH_HEIGHT / 2
    shade = 1 - SHADE * np.arange(MOUTH_HEIGHT)[:, None, None] / MOUTH_HEIGHT
    picture = np.broadcast_to(np.array(SKIN) * shade, (len(motion.values), MOUTH_HEIGHT, MOUTH_WIDTH, 3))
    for colour, across, down in ((LIPS, width, outer), (INSIDE, INNER_WIDTH * width, opening)):
        across, down = np.maximum(across, THINNEST_PX), np.maximum(down, THINNEST_PX)  # noqa: PLW2901
        radius = np.hypot(x / across, y / down)
        share = np.clip(0.5 + (1 - radius) * np.minimum(across, down), 0, 1)[..., None]  # of the pixel in the ellipse
        picture = (1 - share) * picture + share * np.array(colour)
    track = Track(motion, np.ones(len(motion.values), dtype=bool), np.rint(picture).astype(np.uint8))
    source = {"file": "", "licence": "synthesised by lipmotion"}
    features = analysed(sentence.audio).mfcc()
    return Utterance(sentence.name, sentence.audio, features, track, sentence.words, sentence.split, source)


def _targets(units: Timeline[Unit], grid_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return target opening and width, constant within phones; at rest outside the units [shape=(2, len(grid_s))]."""
    targets = np.repeat(np.array(LIP_TARGETS["sil"]).T, len(grid_s), axis=1)
    for span in units:
        shapes = LIP_TARGETS[span.label.phone]
        edges_s = np.linspace(span.start_s, span.end_s, len(shapes) + 1)
        for shape, start_s, end_s in zip(shapes, edges_s, edges_s[1:], strict=False):
            targets[:, (grid_s >= start_s) & (grid_s < end_s)] = np.array(shape)[:, None]
    return targets


def write_film(path: Path, frames: Iterable[NDArray[np.uint8]], sound: Audio | Path, fps: float = CAMERA_HZ) -> None:
    """Write pictures with a sound, or with that of a file, as a video."""
    from lipmotion.speech.sound.audio_files import read_audio
    from lipmotion_faces.video.mp4 import write_mp4

    write_mp4(path, frames, fps=fps, audio=read_audio(sound) if isinstance(sound, Path) else sound)


def write_toy_recordings(directory: Path, *, sentences: int = 12, fps: float = CAMERA_HZ) -> list[Path]:
    """Write the toy corpus as recordings: ``toy00.mp4``, ``toy00.txt``, ..., and the three lists; return the videos."""
    from lipmotion_faces.base import Staging
    from lipmotion_faces.portrait import Woman

    spoken = toy_sentences(sentences)
    directory.mkdir(exist_ok=True)
    face = Woman(Staging(size=FACE_HEIGHT, blinks=False, gaze=False, brows=False, head=False))
    for sentence in spoken:
        motion = toy_motion(sentence.units, MOTION_HZ)
        silence = Timeline(tuple(span for span in sentence.units if is_silent(span.label.phone)))  # no shapes of phones
        video = directory / f"{sentence.name}.mp4"
        write_film(video, face.render(motion, silence, fps=fps), sentence.audio, fps)
        video.with_suffix(".txt").write_text(" ".join(sentence.words) + "\n")
    for split in ("train", "val", "test"):
        names = [sentence.name for sentence in spoken if sentence.split == split]
        (directory / f"{split}.txt").write_text("".join(f"{name}\n" for name in names))
    return [directory / f"{sentence.name}.mp4" for sentence in spoken]
