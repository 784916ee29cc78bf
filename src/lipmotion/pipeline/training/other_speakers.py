"""Speech of other speakers with phones in time, without motion: training data of acoustic models.

Source: Xie & Liu 2007, §3.4: the first stage of the training uses audio of many speakers, without video.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lipmotion.errors import AlignmentError, CorpusError, InputError, shorten
from lipmotion.formats.label_files import CHAPTER, find_labels
from lipmotion.pipeline.analysis.transcribe import align_or_recognise
from lipmotion.pipeline.model import load_model
from lipmotion.pipeline.training.prompts import prompts
from lipmotion.speech.recognition.agreement import DOUBTFUL_SCORE, measure_fit
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.acoustic_conditions import mix_noise
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.installed import explain_missing_synthesiser, list_installed, speak_sentences
from lipmotion.speech.voices.synthesiser import SyntheticVoice
from lipmotion.storage.sources import AUDIO_SUFFIXES, check_listable
from lipmotion.types import Audio, Item, Monitor, Span, Timeline, Unit, silent_monitor
from lipmotion.units import SILENCE, Lexicon, is_silent

SENTENCES = 60  # number of sentences that every synthetic voice speaks by default
PAUSE_S, FLOOR_DB = 0.25, 50.0
"""Seconds of silence before and after a synthetic sentence, and its noise in decibels under the speech. Synthesisers
begin at once, and after digital silence: both would shift features that are normalised per recording."""
SPEAKER_PARTS, HELD_OUT_PART = 4, 1
"""Speakers are divided into this number of parts by their names; those of this part are held out."""


@dataclass(frozen=True, eq=False)
class SpokenSentence:
    """A sentence of a speaker.

    name    : unique name of the sentence and the voice
    speaker : name of the speaker
    audio   : the sound, at 16 kHz
    phones  : phones in time, from 0 s to the end of the sound, each with its word
    """

    name: str
    speaker: str
    audio: Audio
    phones: Timeline[Unit]


def is_held_out_speaker(speaker: str) -> bool:
    """Return whether the speech of a speaker is held out to evaluate models; about a quarter of all speakers are.

    It depends on the name alone (CRC-32 modulo 4 is 1), not on the other voices that are installed or recorded.
    """
    return zlib.crc32(speaker.encode()) % SPEAKER_PARTS == HELD_OUT_PART


def synthesise_sentences(
    texts: Sequence[str] | None = None,
    voices: Sequence[SyntheticVoice] | None = None,
    *,
    lexicon: Lexicon | None = None,
) -> Iterator[SpokenSentence]:
    """Yield every text in every synthetic voice, voice by voice: of flite, festival and espeak-ng, if installed.

    texts   : None: the first 60 of ``prompts``, which contain every phone of the dictionary
    voices  : None: all that are installed
    Every sentence gets 0.25 s of silence before and after it, and white noise 50 dB under the speech. The same
    arguments give the same samples.
    Raises MissingDependencyError: no synthesiser is installed. Raises InputError: as ``speak_sentences``.
    """
    chosen = list_installed() if voices is None else tuple(voices)
    if not chosen:
        raise explain_missing_synthesiser()
    texts = [prompt.text for prompt in prompts(count=SENTENCES).chosen] if texts is None else texts
    for voice in chosen:
        for number, (audio, units, _) in enumerate(speak_sentences(texts, voice, lexicon), start=1):
            pause = np.zeros(round(PAUSE_S * audio.rate_hz), np.float32)
            longer = Audio(np.concatenate([pause, audio.samples, pause]), audio.rate_hz)
            spoken = list(units.shifted(PAUSE_S))
            for place in (0, -1):
                if is_silent(spoken[place].label.phone):
                    del spoken[place]
            before = Span(0.0, spoken[0].start_s, Unit(SILENCE))
            after = Span(spoken[-1].end_s, longer.duration_s, Unit(SILENCE))
            noisy = mix_noise(longer, "white", FLOOR_DB, seed=number)
            name = f"{voice.synthesiser}-{voice.name}-{number:03d}"
            yield SpokenSentence(name, voice.speaker, noisy, Timeline((before, *spoken, after)))


def align_recordings(
    folder: str | Path, phones: Recogniser, *, lexicon: Lexicon | None = None, monitor: Monitor = silent_monitor
) -> Iterator[SpokenSentence]:
    """Yield the recordings of a folder and of its sub-folders that have a transcript or phones in time.

    phones  : the recogniser that aligns transcripts; of the kind ``general`` for speakers on whom its own models were
              not trained. Labelled phones are used as they are
    monitor : called with the recordings that cannot be used: damaged, or with a transcript that does not agree with
              the sound
    The speaker is the name of the sub-folder, or of the recording if it is in none; with the transcripts of a chapter,
    as in LibriSpeech, the reader, with whose number the name begins.
    Raises CorpusError: no such folder, or no recording with a transcript in it.
    """
    root, lexicon = Path(folder), lexicon or Lexicon()
    if not root.is_dir():
        raise CorpusError(f"{root}: no such folder; give one of recordings with a .txt, .lab or .TextGrid beside them")
    check_listable(root)
    is_any_transcribed = False
    for path in sorted(path for path in root.rglob("*") if path.suffix.lower() in AUDIO_SUFFIXES):
        inner = path.relative_to(root)
        name = "-".join(inner.with_suffix("").parts)
        speaker = inner.parts[0] if len(inner.parts) > 1 else name
        reader, _, rest = path.stem.partition("-")
        if path.with_name(f"{reader}-{rest.partition('-')[0]}{CHAPTER}").is_file():
            speaker = reader
        try:
            labels = find_labels(path)
            words = labels.words
            if words is None and labels.phones is None:
                continue
            is_any_transcribed = True
            foreign = [word for word in words or () if not word.isascii() and not lexicon.known(word)]
            if foreign and labels.phones is None:  # what other languages do with their letters is no guide to English
                raise InputError(f"no pronunciation of {shorten(foreign[0])!r}, required English words, or a lexicon")
            audio = read_audio(path)
            if labels.phones is None:
                units = align_or_recognise(phones, audio, words, lexicon)
            else:
                units = labels.phones.between(0, audio.duration_s)
            score = measure_fit(audio, units).score
            if score < DOUBTFUL_SCORE:
                found = f"its phones agree with the sound at {score:.1f}, required {DOUBTFUL_SCORE} or more"
                raise InputError(f"its transcript seems not to be what is said ({found}); check it")
            yield SpokenSentence(name, speaker, audio, units)
        except (AlignmentError, InputError) as error:
            monitor(Item(name, "skipped", str(error)))
    if not is_any_transcribed:
        raise CorpusError(f"{root}: no recording with a transcript; put what is said in x.wav into x.txt beside it")


def synthesise_others(
    *,
    synthetic: bool = False,
    recordings: str | Path | None = None,
    lexicon: Lexicon | None = None,
    monitor: Monitor = silent_monitor,
) -> Iterator[SpokenSentence]:
    """Yield the sentences of ``lipmotion train --voices --recordings``, besides the corpus.

    synthetic  : include sentences of all installed synthetic voices but those of held-out speakers
    recordings : a folder of transcribed recordings, which are aligned by the general phone models
    Raises MissingDependencyError, CorpusError: as ``synthesise_sentences`` and ``align_recordings``.
    """
    if recordings is not None:
        general = Recogniser(load_model().phones, "general")
        yield from align_recordings(recordings, general, lexicon=lexicon, monitor=monitor)
    if synthetic:
        chosen = [voice for voice in list_installed() if not is_held_out_speaker(voice.speaker)]
        yield from synthesise_sentences(voices=chosen, lexicon=lexicon)
