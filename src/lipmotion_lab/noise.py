"""Held-out recordings with added noise: the same motion, with features and phones of the noisy sound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.sound.acoustic_conditions import FEWEST_TALKERS, NOISE_KINDS, noisy_audio
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ, read_audio
from lipmotion.storage.files import check_listable
from lipmotion.types import Audio, Monitor, silent_monitor, with_progress
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, HeldOutRecordings

LONGEST_S = 30
"""Seconds that are read of each talker."""
BABBLE = "babble"


@dataclass(frozen=True)
class NoiseConditions:
    """Noise that is added to the held-out recordings.

    kinds     : of ``speech.sound.acoustic_conditions.NOISE_KINDS``
    ratios_db : signal-to-noise ratios
    talkers   : recordings for the babble
    """

    kinds: tuple[str, ...] = ()
    ratios_db: tuple[float, ...] = (20.0, 10.0, 5.0, 0.0)
    talkers: tuple[Audio, ...] = ()

    def __post_init__(self) -> None:
        unknown = [kind for kind in self.kinds if kind not in NOISE_KINDS]
        if unknown:
            raise InputError(f"unknown noise {unknown[0]!r}; required some of: {', '.join(NOISE_KINDS)}")
        if BABBLE in self.kinds and len(self.talkers) < FEWEST_TALKERS:
            raise InputError(f"a babble of {len(self.talkers)} talkers; required at least {FEWEST_TALKERS}: --talkers")


def add_noise(
    recordings: HeldOutRecordings,
    kind: str,
    snr_db: float,
    talkers: Sequence[Audio] = (),
    seed: int = 0,
    monitor: Monitor = silent_monitor,
) -> HeldOutRecordings:
    """Return recordings with noise added, in the condition ``audio only``; every clip has its own noise.

    kind, snr_db, talkers, seed : as in ``speech.sound.acoustic_conditions.noisy_audio``
    Raises InputError: as ``speech.sound.acoustic_conditions.noisy_audio``.
    """
    utterances, recognitions = [], []
    for number, utterance in enumerate(with_progress(recordings.utterances, "adding noise", monitor)):
        audio = noisy_audio(utterance.audio, kind, snr_db, talkers, seed + number)
        utterances.append(replace(utterance, audio=audio, features=analysed(audio).mfcc()))
        recognitions.append(recordings.phones.recognition(audio, utterances[-1].features))
    phones = [found.units for found in recognitions]
    return replace(recordings, utterances=utterances, conditions={AUDIO_ONLY: phones}, recognitions=recognitions)


def read_talkers(folder: Path) -> list[Audio]:
    """Return the first half minute of every recording in a folder. Raises InputError: no such folder, or none in it."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give one with recordings of other people, for the babble")
    check_listable(folder)
    talkers = []
    for path in sorted(folder.iterdir()):
        try:
            audio = read_audio(path)
        except InputError:  # a list or a transcript
            continue
        talkers.append(Audio(audio.samples[: LONGEST_S * SPEECH_RATE_HZ], audio.rate_hz))
    if not talkers:
        raise InputError(f"{folder}: no recording in it; give a folder with recordings of other people, for the babble")
    return talkers
