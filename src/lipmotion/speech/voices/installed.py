"""The installed synthetic voices, and sentences spoken by them."""

from __future__ import annotations

import logging
import re
import shutil
import wave
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from lipmotion.errors import InputError, LipMotionError, MissingDependencyError, shorten
from lipmotion.extensions import install_command
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.espeak import ESPEAK_NG
from lipmotion.speech.voices.inventory_phones import convert_phones
from lipmotion.speech.voices.synthesiser import (
    ARPABET_PHONES,
    SynthesisedSentence,
    Synthesiser,
    SyntheticVoice,
    run_program,
)
from lipmotion.storage.locks import open_temporary
from lipmotion.types import Audio, Span, Timeline, Unit
from lipmotion.units import Lexicon, split_words

FLITE_PACKAGE = "flite"
UNUSED = frozenset({"kal", "awb_time"})  # kal is kal16 at 8 kHz; awb_time can only say the time of day
SPEAKERS = {"kal16": "kal"}


def _list_flite() -> tuple[SyntheticVoice, ...]:
    if shutil.which("flite") is None:
        return ()
    names = run_program(["flite", "-lv"], FLITE_PACKAGE).partition(":")[2].split()
    return tuple(SyntheticVoice(name, "flite", SPEAKERS.get(name, name)) for name in names if name not in UNUSED)


def _say_with_flite(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    path = folder / "flite.wav"
    for text in texts:
        command = ["flite", "-voice", voice, "-psdur", "-o", str(path), "-t", text]
        printed = run_program(command, FLITE_PACKAGE)
        yield SynthesisedSentence(read_audio(path), parse_phone_ends(printed), path)


def parse_phone_ends(printed: str) -> Timeline[str]:
    """Return phones in time from what ``flite -psdur`` prints: ``pau:0.220 k:0.346``, a line an utterance.

    The number is the end of the phone in its utterance; a long text is several utterances.
    Raises InputError: it prints something else.
    """
    spans, start_s = [], 0.0
    for line in printed.splitlines():
        first_s = start_s
        for entry in line.split():
            label, _, end = entry.partition(":")
            try:
                end_s = max(first_s + float(end), start_s)
            except ValueError as error:
                raise InputError(f"flite prints {entry!r}, required a phone and its end, as in 'k:0.346'") from error
            spans.append(Span(start_s, end_s, label))
            start_s = end_s
    return Timeline(tuple(spans))


FLITE = Synthesiser("flite", FLITE_PACKAGE, _list_flite, _say_with_flite, ARPABET_PHONES)


FESTIVAL_PACKAGE = "festival festvox-us-slt-hts"
MARK = "-- sentence"
LISTING = """(mapcar (lambda (name)
  (let ((about (cadr (voice.description name))))
    (format t "%s %s %s\\n" name (cadr (assoc 'language about)) (cadr (assoc 'dialect about)))))
  (voice.list))"""
SPEAKING = f"""(define (say text path)
  (let ((utterance (utt.synth (eval (list 'Utterance 'Text text)))))
    (format t "{MARK}\\n")
    (mapcar (lambda (segment) (format t "%s %s %s\\n" (item.name segment) (item.feat segment "segment_start")
                                      (item.feat segment "end")))
            (utt.relation.items utterance 'Segment))
    (utt.save.wave utterance path 'riff)))
"""


def _list_festival() -> tuple[SyntheticVoice, ...]:
    if shutil.which("festival") is None:
        return ()
    rows = [line.split() for line in run_program(["festival", "-b", LISTING], FESTIVAL_PACKAGE).splitlines()]
    names = [row[0] for row in rows if row[1:] == ["english", "american"]]
    speakers = (re.sub(r"_.*", "", re.sub(r"^cmu_us_", "", name)) for name in names)  # slt of cmu_us_slt_arctic_hts
    return tuple(SyntheticVoice(name, "festival", who) for name, who in zip(names, speakers, strict=True))


def _say_with_festival(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    paths = [folder / f"{number}.wav" for number in range(len(texts))]
    script = folder / "say.scm"
    calls = [f"(say {_quote(text)} {_quote(str(path))})" for text, path in zip(texts, paths, strict=True)]
    script.write_text("\n".join([f"(voice_{voice})", SPEAKING, *calls, ""]), encoding="utf-8")
    printed = run_program(["festival", "-b", str(script)], FESTIVAL_PACKAGE, len(texts))
    parts = printed.split(f"{MARK}\n")[1:]
    if len(parts) != len(texts):
        raise InputError(f"festival said {len(parts)} of {len(texts)} sentences; try another text or voice")
    for path, part in zip(paths, parts, strict=True):
        spans = []
        for line in part.splitlines():
            try:
                label, start, end = line.split()
                spans.append(Span(float(start), float(end), label))
            except ValueError as error:
                raise InputError(f"festival prints {line!r}, required a phone, its start and its end") from error
        yield SynthesisedSentence(read_audio(path), Timeline(tuple(spans)), path)
        path.unlink()


def _quote(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


FESTIVAL = Synthesiser("festival", FESTIVAL_PACKAGE, _list_festival, _say_with_festival, ARPABET_PHONES)


LOG = logging.getLogger("lipmotion")
SYNTHESISERS: dict[str, Synthesiser] = {synthesiser.name: synthesiser for synthesiser in (FLITE, FESTIVAL, ESPEAK_NG)}

DEFAULT_VOICES = (("espeak-ng", "en-us+f2"), ("flite", "slt"))
"""Synthesiser and name of the voices that speak where none is asked for: that of the Python package first."""


class VoicedSentence(NamedTuple):
    """A sentence that a voice has said."""

    audio: Audio  # the sound at 16 kHz
    units: Timeline[Unit]  # phones in time, from 0 s to the end of the sound
    sound: Path  # of the synthesiser's own rate; the file is there until the next sentence is asked for

    def own_sound(self) -> Audio:
        """Return the sound at the synthesiser's own rate. Raises InputError: its file is gone, or no sound file."""
        try:
            with wave.open(str(self.sound)) as file:
                rate_hz = file.getframerate()
        except (OSError, EOFError, wave.Error) as error:
            raise InputError(f"the synthesiser wrote no sound that can be read ({error}); try another voice") from error
        return read_audio(self.sound, rate_hz)


def list_installed() -> tuple[SyntheticVoice, ...]:
    """Return the American English voices of the synthesisers that are installed; none where none is."""
    return tuple(voice for synthesiser in SYNTHESISERS.values() for voice in synthesiser.voices())


def list_voices() -> tuple[SyntheticVoice, ...]:
    """Return the installed voices of all languages: the American English ones first.

    A synthesiser that is installed and does not work is left out, with a warning.
    """
    working = [synthesiser for synthesiser in SYNTHESISERS.values() if _works(synthesiser)]
    english = tuple(voice for synthesiser in working for voice in synthesiser.voices())
    return (*english, *(voice for synthesiser in working for voice in synthesiser.others()))


def _works(synthesiser: Synthesiser) -> bool:
    """Return whether a synthesiser can list its voices; if not, log why."""
    try:
        synthesiser.voices()
    except LipMotionError as error:
        LOG.warning("%s is left out: %s", synthesiser.name, error)
        return False
    return True


def find_voice(name: str) -> SyntheticVoice:
    """Return the installed voice of a name.

    name : ``SYNTHESISER:VOICE``, as in ``flite:slt`` or ``espeak-ng:de``; or the voice's name alone, where only one
           synthesiser has it. A language of espeak-ng may be followed by a variant: ``espeak-ng:de+f3``.
    Raises MissingDependencyError: no synthesiser, or not that one, is installed. Raises InputError: none, or several.
    """
    maker, colon, rest = name.rpartition(":")
    if colon and maker not in SYNTHESISERS:
        raise InputError(f"unknown synthesiser {shorten(maker)!r}; required one of: {', '.join(SYNTHESISERS)}")
    synthesisers = [SYNTHESISERS[maker]] if colon else [each for each in SYNTHESISERS.values() if _works(each)]
    if not colon and not any(synthesiser.voices() for synthesiser in synthesisers):
        raise explain_missing_synthesiser()
    matches = []
    for synthesiser in synthesisers:
        listed = {voice.name: voice for voice in (*synthesiser.others(), *synthesiser.voices())}
        if rest in listed:
            matches.append(listed[rest])
        elif listed and _is_other(rest, synthesiser):
            matches.append(SyntheticVoice(rest, synthesiser.name, f"espeak-{rest}", rest.partition("+")[0]))
        elif colon and not listed:
            raise MissingDependencyError(f"{maker} is not installed: {explain_install(synthesiser)}")
    if not matches:
        raise InputError(f"no voice {shorten(name)!r} is installed; lipmotion speak --voices lists those that are")
    if len(matches) > 1:
        names = ", ".join(voice.full_name for voice in matches)
        raise InputError(f"several voices are called {name!r}; give one of: {names}")
    return matches[0]


def choose_voice() -> SyntheticVoice:
    """Return the first of ``DEFAULT_VOICES`` that is installed, else the first installed voice.

    Raises MissingDependencyError: no synthesiser is installed.
    """
    voices = ((voice, name) for maker, name in DEFAULT_VOICES for voice in SYNTHESISERS[maker].voices())
    voice = next((voice for voice, name in voices if voice.name == name), None) or next(iter(list_voices()), None)
    if voice is None:
        raise explain_missing_synthesiser()
    return voice


def explain_missing_synthesiser() -> MissingDependencyError:
    """Return the error that says how to install a synthesiser."""
    debian = " ".join(filter(None, (synthesiser.package for synthesiser in SYNTHESISERS.values())))
    return MissingDependencyError(
        f"no speech synthesiser is installed; install one: {install_command(ESPEAK_NG.extra)}, or: apt install {debian}"
    )


def speak_sentences(
    texts: Sequence[str], voice: SyntheticVoice, lexicon: Lexicon | None = None
) -> Generator[VoicedSentence, None, None]:
    """Yield sentences in a voice, each with its phones in time, from 0 s to its end; one run makes all where it can.

    lexicon : its pronunciations tell which vowels are unstressed; the built-in one by default
    Raises MissingDependencyError: the synthesiser is not installed (the message names the package).
    Raises InputError: no such voice, a text without a word, or one that the synthesiser cannot say.
    """
    synthesiser = SYNTHESISERS[voice.synthesiser]
    names = [known.name for known in synthesiser.voices()]
    if not names:
        raise MissingDependencyError(f"{synthesiser.name} has no English voice here: {explain_install(synthesiser)}")
    if voice.name not in names and not _is_other(voice.name, synthesiser):
        raise InputError(f"{synthesiser.name} has no voice {voice.name!r} here; it has: {', '.join(names)}")
    words = [split_words(text) for text in texts]
    known = (lexicon or Lexicon()) if voice.language.partition("-")[0] == "en" else None
    with open_temporary() as folder:
        plain = [" ".join(text.split()) for text in texts]
        sentences = synthesiser.synthesise(voice.name, plain, folder) if plain else iter(())
        for sentence, its_words in zip(sentences, words, strict=True):
            phone_map = sentence.phone_map or synthesiser.phone_map
            written = its_words if sentence.words is None else sentence.words
            units = convert_phones(sentence.phones, phone_map, written, known, sentence.audio.duration_s)
            yield VoicedSentence(sentence.audio, units, sentence.sound)


def _is_other(name: str, synthesiser: Synthesiser) -> bool:
    """Return whether a name is that of a voice of another language, as it is or in a variant of an English voice."""
    language, plus, variant = name.partition("+")
    variants = {voice.name.partition("+")[2] for voice in synthesiser.voices()}
    return language in {voice.name for voice in synthesiser.others()} and (not plus or variant in variants)


def explain_install(synthesiser: Synthesiser) -> str:
    """Return the command that installs a synthesiser, for a message."""
    return install_command(synthesiser.extra) if synthesiser.extra else f"apt install {synthesiser.package}"
