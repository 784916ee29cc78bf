"""Speech of many speakers with its phones in time: what acoustic models learn from before they see a face.

Source: Xie & Liu 2007, §3.4, first stage of the training: audio of many speakers, no video.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lipmotion.corpora.labels import labels_beside
from lipmotion.corpora.source_recordings import AUDIO_SUFFIXES
from lipmotion.errors import AlignmentError, CorpusError, InputError, MissingDependencyError
from lipmotion.pipeline.corpus.prompts import prompts
from lipmotion.pipeline.model import load_model
from lipmotion.pipeline.transcribe import phones_in_time
from lipmotion.speech.agreement import DOUBTFUL_SCORE, agreement_score
from lipmotion.speech.audio_files import read_audio
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.noise import noisy_audio
from lipmotion.speech.recogniser import Recogniser
from lipmotion.speech.voices.installed import SYNTHESISERS, installed_voices, speak_sentences
from lipmotion.speech.voices.synthesiser import SyntheticVoice
from lipmotion.storage.files import check_listable
from lipmotion.types import Audio, Features, Item, Monitor, ParallelMap, Span, Timeline, Unit, silent_monitor
from lipmotion.units import SILENCE, Lexicon, is_silent

SENTENCES = 60
PAUSE_S, FLOOR_DB = 0.25, 50.0
"""Synthesisers begin at once, out of a silence that no room has: both would shift features normalised per recording."""
SPEAKER_PARTS, HELD_OUT_PART = 4, 1
"""Speakers fall into so many parts by their names; those in this one are for judging."""


@dataclass(frozen=True, eq=False)
class SpokenSentence:
    """A sentence by a speaker.

    name   : of the sentence and the voice, unique
    phones : in time, from 0 s to the end of the sound, each with its word
    """

    name: str
    speaker: str
    audio: Audio
    phones: Timeline[Unit]


class VoiceExample(NamedTuple):
    """A sentence as models hear it.

    features : 39 MFCC a frame, normalised over the sentence
    units    : its phones in time
    """

    features: Features
    units: Timeline[Unit]
    speaker: str


def is_held_out_speaker(speaker: str) -> bool:
    """Whether what a speaker says is kept aside to judge models with; about a quarter of all speakers are.

    The name alone decides (CRC-32 modulo 4 is 1): no speaker changes sides with what else is installed or recorded.
    """
    return zlib.crc32(speaker.encode()) % SPEAKER_PARTS == HELD_OUT_PART


def synthetic_sentences(
    texts: Sequence[str] | None = None,
    voices: Sequence[SyntheticVoice] | None = None,
    *,
    lexicon: Lexicon | None = None,
    each: ParallelMap = map,
) -> Iterator[SpokenSentence]:
    """Give every text in every voice, voice by voice: flite, festival, espeak-ng, as far as they are installed.

    texts  : the first 60 of ``prompts`` by default, which say every phone of the dictionary
    voices : all that are installed by default
    each   : shares the work, a voice at a time; the same arguments give the same samples
    A pause of 0.25 s is put before and after each, and white noise 50 dB under the speech throughout.
    Raises MissingDependencyError: no synthesiser is installed. Raises InputError: as ``speech.voices.speak_sentences``.
    """
    chosen = installed_voices() if voices is None else tuple(voices)
    if not chosen:
        packages = " ".join(synthesiser.package for synthesiser in SYNTHESISERS.values())
        raise MissingDependencyError(f"no speech synthesiser is installed; install one or more: apt install {packages}")
    said = [prompt.text for prompt in prompts(count=SENTENCES).chosen] if texts is None else list(texts)
    for sentences in each(partial(_in_voice, texts=said, lexicon=lexicon), chosen):
        yield from sentences


def recorded_sentences(
    folder: str | Path,
    phones: Recogniser,
    *,
    speakers: Mapping[str, str] | None = None,
    lexicon: Lexicon | None = None,
    monitor: Monitor = silent_monitor,
) -> Iterator[SpokenSentence]:
    """Give the recordings of a folder, and of its sub-folders, that have a transcript beside them, phones aligned.

    phones   : aligns them; of the kind ``general`` where nobody in the folder spoke for its own models
    speakers : patterns of names (``*`` any letters) to who speaks; the first that fits holds. Of others, the
               sub-folder says who speaks, and without any the name is taken: give the speaker of two such recordings,
               or they may come to be on both sides of ``is_held_out_speaker``
    monitor  : is told of those that cannot be used: damaged, or of words that are not what is said, or not English
    Raises CorpusError: there is no such folder, or no recording with a transcript in it.
    """
    root, lexicon = Path(folder), lexicon or Lexicon()
    if not root.is_dir():
        raise CorpusError(f"{root}: no such folder; give one of recordings with a .txt, .lab or .TextGrid beside them")
    check_listable(root)
    found = False
    for path in sorted(path for path in root.rglob("*") if path.suffix.lower() in AUDIO_SUFFIXES):
        name = "-".join(path.relative_to(root).with_suffix("").parts)
        speaker = _speaker(name, path.relative_to(root), speakers or {})
        try:
            words = labels_beside(path).words
            if words is not None:
                found = True
                yield SpokenSentence(name, speaker, *_aligned(path, words, phones, lexicon))
        except (AlignmentError, InputError) as error:
            monitor(Item(name, "skipped", str(error)))
    if not found:
        raise CorpusError(f"{root}: no recording with a transcript; put what is said in x.wav into x.txt beside it")


def voice_examples(sentences: Iterable[SpokenSentence]) -> Iterator[VoiceExample]:
    """Give sentences as models hear them. Nothing is kept."""
    return (VoiceExample(mfcc(sentence.audio), sentence.phones, sentence.speaker) for sentence in sentences)


def other_voices(
    *,
    synthetic: bool = False,
    recordings: str | Path | None = None,
    lexicon: Lexicon | None = None,
    monitor: Monitor = silent_monitor,
) -> Iterator[VoiceExample]:
    """Give what ``train --voices --recordings`` learns from besides a corpus.

    synthetic  : all installed voices but those that are for judging
    recordings : a folder of transcribed recordings, aligned by the general phone models
    Raises MissingDependencyError, CorpusError: as ``synthetic_sentences`` and ``recorded_sentences``.
    """
    if recordings is not None:
        general = Recogniser(load_model().phones, "general")
        yield from voice_examples(recorded_sentences(recordings, general, lexicon=lexicon, monitor=monitor))
    if synthetic:
        chosen = [voice for voice in installed_voices() if not is_held_out_speaker(voice.speaker)]
        yield from voice_examples(synthetic_sentences(voices=chosen, lexicon=lexicon))


def _in_voice(voice: SyntheticVoice, texts: Sequence[str], lexicon: Lexicon | None) -> list[SpokenSentence]:
    name = f"{voice.synthesiser}-{voice.name}"
    return [
        SpokenSentence(f"{name}-{number:03d}", voice.speaker, *_in_a_room(audio, units, number))
        for number, (audio, units) in enumerate(speak_sentences(texts, voice, lexicon), start=1)
    ]


def _in_a_room(audio: Audio, units: Timeline[Unit], seed: int) -> tuple[Audio, Timeline[Unit]]:
    """Return the sentence between two pauses, over a faint noise."""
    pause = np.zeros(round(PAUSE_S * audio.rate_hz), np.float32)
    longer = Audio(np.concatenate([pause, audio.samples, pause]), audio.rate_hz)
    spoken = list(units.shifted(PAUSE_S))
    if is_silent(spoken[0].label.phone):
        del spoken[0]
    if is_silent(spoken[-1].label.phone):
        del spoken[-1]
    before = Span(0.0, spoken[0].start_s, Unit(SILENCE))
    after = Span(spoken[-1].end_s, longer.duration_s, Unit(SILENCE))
    return noisy_audio(longer, "white", FLOOR_DB, seed=seed), Timeline((before, *spoken, after))


def _speaker(name: str, inner: Path, speakers: Mapping[str, str]) -> str:
    given = (speaker for pattern, speaker in speakers.items() if fnmatchcase(name, pattern))
    return next(given, inner.parts[0] if len(inner.parts) > 1 else name)


def _aligned(path: Path, words: Sequence[str], phones: Recogniser, lexicon: Lexicon) -> tuple[Audio, Timeline[Unit]]:
    audio = read_audio(path)
    units = phones_in_time(phones, audio, mfcc(audio), words, lexicon)
    found = agreement_score(audio, units)
    if found < DOUBTFUL_SCORE:
        raise InputError(
            f"its transcript seems not to be what is said (its phones agree with the sound at {found:.1f}, required "
            f"{DOUBTFUL_SCORE} or more); check it"
        )
    return audio, units
