"""espeak-ng: English and many other languages by formants, in the variants that sound like people.

Only its library tells when each phone begins. The library is called in a process of its own (``espeak_events``), so
that its state, its crashes and its licence (GPL) stay there. One such process speaks all sentences.

The library is that of the Python package ``espeakng-loader``: the same text gives the same sound on every machine.
"""

from __future__ import annotations

import json
import logging
import re
import sys
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.errors import InputError, MissingDependencyError, shorten
from lipmotion.extensions import install_command
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.espeak_events import PART
from lipmotion.speech.voices.espeak_events import SILENCE as NO_SOUND
from lipmotion.speech.voices.synthesiser import (
    ESPEAK_PHONES,
    PhoneMap,
    SynthesisedSentence,
    Synthesiser,
    SyntheticVoice,
    complete_map,
    run_program,
)
from lipmotion.types import Audio, Span, Timeline
from lipmotion.types.languages import ENGLISH, LANGUAGES, find_foreign
from lipmotion.units import SILENCE, Lexicon, Pronunciation, list_phone_classes
from lipmotion.units.ipa_phones import read_ipa
from lipmotion.units.lexicon import SpokenForm

CLOSING = list_phone_classes()["stop"] | list_phone_classes()["affricate"]
VOWELS = list_phone_classes()["vowel"]
CLOSURE_SHARE = 0.03  # share of the largest sample that no sample of a closure exceeds: some variants have breath in it
LONGEST_CLOSURE_S = 0.06
LATE_L_S, L_SHARE = 0.045, 0.45
"""An l that is reported so shortly before its end is late: it gets this share of vowel and l, as in our alignments."""

Starts = Sequence[tuple[str, float]]


def correct_times(starts: Starts, audio: Audio, phone_map: PhoneMap = ESPEAK_PHONES) -> Timeline[str]:
    """Return phones in time: each from its corrected start to that of the next, or to the end of the sound."""
    labels = [label for label, _ in starts]
    names = [(phone_map.get(label) or ("",))[-1] for label in labels]  # the last phone; empty: part of another, unknown
    edges_s = [*(start_s for _, start_s in starts), audio.duration_s]
    closed = np.abs(audio.samples) < CLOSURE_SHARE * np.abs(audio.samples).max(initial=0)
    for index in range(1, len(labels)):
        before, here = names[index - 1 : index + 1]
        if here in CLOSING and before != SILENCE:
            burst = round(edges_s[index] * audio.rate_hz)
            first = max(burst - round(LONGEST_CLOSURE_S * audio.rate_hz), 0)
            loud = np.flatnonzero(~closed[first:burst])
            closure_s = (first + int(loud[-1]) + 1 if len(loud) else first) / audio.rate_hz
            edges_s[index] = max(closure_s if burst > first else edges_s[index], edges_s[index - 1])
        elif here == "l" and before in VOWELS and edges_s[index + 1] - edges_s[index] < LATE_L_S:
            length_s = edges_s[index + 1] - edges_s[index - 1]
            edges_s[index] = min(edges_s[index], edges_s[index + 1] - L_SHARE * length_s)
    spans = zip(edges_s, edges_s[1:], labels, strict=False)
    return Timeline(tuple(Span(start_s, max(start_s, end_s), label) for start_s, end_s, label in spans))


LOG = logging.getLogger("lipmotion")
NAME, WHEEL, EXTRA = "espeak-ng", "espeakng_loader", "text"
LANGUAGE = "en-us"
VARIANTS = ("f1", "f2", "f3", "f4", "m1", "m2", "m3", "m4", "m7", "m8")
"""The variants with the vocal tract, pitch and breath of a person; not the robots, whispers, echoes and growls."""
PROGRAM = [sys.executable, "-I", str(Path(__file__).with_name("espeak_events.py"))]
DATA = "espeak-ng-data"
STRESS_MARKS = "',%="  # what it writes before the vowel of a stressed syllable
NO_IPA: PhoneMap = {NO_SOUND: ESPEAK_PHONES[NO_SOUND], PART: ESPEAK_PHONES[PART]}
LARGEST_VOICE_BYTES = 1 << 16  # most bytes of a file that describes a voice


def find_wheel() -> Path | None:
    """Return the folder of the Python package with library and data; None: it is not installed."""
    spec = find_spec(WHEEL)  # it is not imported
    folders = list(spec.submodule_search_locations or ()) if spec else []
    return Path(folders[0]) if folders and (Path(folders[0]) / DATA).is_dir() else None


def _list_voices() -> tuple[SyntheticVoice, ...]:
    folder = find_wheel()
    variants = [name for name in VARIANTS if folder and (folder / DATA / "voices" / "!v" / name).is_file()]
    return tuple(SyntheticVoice(f"{LANGUAGE}+{name}", NAME, f"espeak-{name}") for name in variants)


def _list_others() -> tuple[SyntheticVoice, ...]:
    """Return a voice of every language; its name and ``+`` and one of ``VARIANTS`` name a voice, too."""
    folder, names = find_wheel(), set[str]()
    for path in (folder / DATA / "lang").rglob("*") if folder else ():
        if path.is_file() and path.stat().st_size <= LARGEST_VOICE_BYTES:
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
            names |= {line.split()[1].lower() for line in lines if line.startswith("language ") and line.split()[1:]}
    return tuple(SyntheticVoice(name, NAME, f"espeak-{name}", name) for name in sorted(names))


def _synthesise(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    ipa = voice.partition("+")[0] != LANGUAGE
    task = {"voice": voice, "texts": list(texts), "folder": str(folder), "ipa": ipa}
    sentences = _ask_library(task, len(texts))
    labels = (label.lstrip(STRESS_MARKS) for starts_of_phones in sentences for label, _, _ in starts_of_phones)
    phone_map, unknown = complete_map(labels, NO_IPA if ipa else ESPEAK_PHONES, ipa=ipa)
    if unknown:
        LOG.warning("espeak-ng says phones that no table has, shown as the nearest or as ax: %s", " ".join(unknown))
    for number, (text, starts_of_phones) in enumerate(zip(texts, sentences, strict=True)):
        path = folder / f"{number}.wav"
        audio = read_audio(path)
        starts = [(label.lstrip(STRESS_MARKS), start_s) for label, start_s, _ in starts_of_phones]
        phones = correct_times(starts, audio, phone_map)
        words = _spell_words(phones, [place for _, _, place in starts_of_phones], text)
        yield SynthesisedSentence(audio, phones, path, words, phone_map)
        path.unlink()


def _spell_words(phones: Timeline[str], places: Sequence[int], text: str) -> Timeline[str]:
    """Return the words of a text in time: what stands between blanks. Words that are said as one (*on the*) are one."""
    words = text.split()
    starts = [at for at in range(len(text)) if not text[at].isspace() and (at == 0 or text[at - 1].isspace())]
    numbers = [max(bisect_right(starts, place) - 1, 0) for place in places]
    groups = [(number, list(group)) for number, group in groupby(range(len(phones)), key=numbers.__getitem__)]
    following = [*(number for number, _ in groups[1:]), len(words)]
    spans = []
    for place, ((number, members), stop) in enumerate(zip(groups, following, strict=True)):
        written = words[number if place else 0 : max(stop, number + 1)]
        spans.append(Span(phones[members[0]].start_s, phones[members[-1]].end_s, " ".join(written)))
    return Timeline(tuple(spans))


def _ask_library(task: dict[str, Any], count: int) -> list[Any]:
    """Return the ``count`` answers of ``espeak_events`` to a task. Raises InputError: it answers something else."""
    wheel = find_wheel() or Path()
    names = ("libespeak-ng.so", "libespeak-ng.dylib", "espeak-ng.dll")
    path = next((wheel / name for name in names if (wheel / name).exists()), wheel / names[0])
    printed = run_program(PROGRAM, NAME, count, json.dumps(task | {"library": str(path), "data": str(wheel)}))
    try:
        answers = json.loads(printed)
    except ValueError:
        answers = None
    if not isinstance(answers, list) or len(answers) != count:
        raise InputError(f"espeak-ng's library answers {printed[:40]!r}; install it again: {install_command(EXTRA)}")
    return answers


ESPEAK_NG = Synthesiser(NAME, "", _list_voices, _synthesise, ESPEAK_PHONES, _list_others, EXTRA)


@dataclass(frozen=True)
class LanguageLexicon(Lexicon):
    """Pronunciations of the words of a language that is not English: the user's, then those of espeak-ng.

    language : its code, of ``LANGUAGES``
    """

    language: str = ENGLISH

    def known(self, word: str) -> bool:
        """Return whether the word has a pronunciation: none is guessed. Raises as ``with_words``."""
        return bool(self.spoken_forms(word))

    def spoken_forms(self, word: str) -> tuple[SpokenForm, ...]:
        """Return every pronunciation of a lower-case word, each phone with the word. Raises as ``with_words``."""
        variants = self.user.get(word) or self.with_words((word,)).user[word]
        return tuple(tuple((phone, word) for phone in variant) for variant in variants)

    def with_words(self, words: Sequence[str]) -> LanguageLexicon:
        """Return the same lexicon that holds the pronunciations of some words; espeak-ng is asked once for all.

        Raises MissingDependencyError: espeak-ng is not installed, and the user's lexicon lacks a word.
        Raises InputError: a word in letters that its language is not written in, or that has no phone.
        """
        missing = [word for word in dict.fromkeys(words) if word not in self.user]
        return replace(self, user=self.user | _pronounce(missing, self.language)) if missing else self


def _pronounce(words: Sequence[str], language: str) -> dict[str, tuple[Pronunciation, ...]]:
    """Return the pronunciations of words, by word. Raises as ``LanguageLexicon.with_words``."""
    spoken = LANGUAGES[language]
    for word in words:
        if letters := find_foreign(word, language):
            what = f"no rules say how {shorten(repr(word))} is said in {spoken.name} ({shorten(letters)}): write it in"
            scripts = " or ".join(spoken.scripts).lower()
            raise InputError(f"{what} {scripts} letters, add it to a lexicon file, or give another language")
    voice = spoken.voice or language
    if voice not in [each.name for each in _list_others()]:
        what = f"no pronunciation of {shorten(repr(words[0]))} in {spoken.name}: install espeak-ng"
        way_out = f"({install_command(EXTRA)}), or give a lexicon file with its {len(words)} words"
        raise MissingDependencyError(f"{what} {way_out}")
    answers = _ask_library({"voice": voice, "words": list(words)}, len(words))
    pronounced: dict[str, tuple[Pronunciation, ...]] = {}
    for word, ipa in zip(words, answers, strict=True):
        phones = tuple(phone for label in re.split(r"[|\s]+", str(ipa)) for phone in read_ipa(label)[0])
        if not phones:
            raise InputError(f"{shorten(repr(word))} has no phone in {spoken.name}; add it to a lexicon file")
        pronounced[word] = (phones,)
    return pronounced
