"""Recordings heard in noise: the same faces, features and phones found anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.pipeline.evaluation.evaluate import Recorded
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.noise import noisy
from lipmotion.speech.read import SPEECH_RATE_HZ, read_audio
from lipmotion.storage.files import check_listable
from lipmotion.types import Audio, Monitor, counted, silent_monitor

AUDIO_ONLY = "audio only"
LONGEST_S = 30
"""So much of a talker is enough."""


def in_noise(
    found: Recorded,
    kind: str,
    snr_db: float,
    talkers: Sequence[Audio] = (),
    seed: int = 0,
    monitor: Monitor = silent_monitor,
) -> Recorded:
    """Return recordings as they are heard in noise, audio only; every clip has noise of its own.

    kind, snr_db, talkers, seed : as ``speech.noise.noisy`` takes them
    Raises InputError: as ``speech.noise.noisy``.
    """
    heard, phones = [], []
    for number, utterance in enumerate(counted(found.utterances, "hearing in noise", monitor)):
        audio = noisy(utterance.audio, kind, snr_db, talkers, seed + number)
        heard.append(replace(utterance, audio=audio, features=mfcc(audio)))
        phones.append(found.phones.recognise(audio, heard[-1].features))
    return replace(found, utterances=heard, conditions={AUDIO_ONLY: phones})


def talkers_in(folder: Path) -> list[Audio]:
    """Return the first half minute of every recording in a folder. Raises InputError: no such folder, or none in it."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give one with recordings of other people, for the babble")
    check_listable(folder)
    found = []
    for path in sorted(folder.iterdir()):
        try:
            audio = read_audio(path)
        except InputError:  # a list, a transcript
            continue
        found.append(Audio(audio.samples[: LONGEST_S * SPEECH_RATE_HZ], audio.rate_hz))
    if not found:
        raise InputError(f"{folder}: no recording in it; give a folder with some, of other people, for the babble")
    return found
