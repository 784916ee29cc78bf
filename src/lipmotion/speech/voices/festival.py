"""Festival: all installed American English voices; one run of the program for all sentences."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.phone_maps import ARPABET_PHONES
from lipmotion.speech.voices.programs import program_output
from lipmotion.speech.voices.synthesiser import SynthesisedSentence, Synthesiser, SyntheticVoice
from lipmotion.types import Span, Timeline

PACKAGE = "festival festvox-us-slt-hts"
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


def _voices() -> tuple[SyntheticVoice, ...]:
    if shutil.which("festival") is None:
        return ()
    rows = [line.split() for line in program_output(["festival", "-b", LISTING], PACKAGE).splitlines()]
    names = [row[0] for row in rows if row[1:] == ["english", "american"]]
    speakers = (re.sub(r"_.*", "", re.sub(r"^cmu_us_", "", name)) for name in names)  # slt of cmu_us_slt_arctic_hts
    return tuple(SyntheticVoice(name, "festival", who) for name, who in zip(names, speakers, strict=True))


def _synthesise(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    paths = [folder / f"{number}.wav" for number in range(len(texts))]
    script = folder / "say.scm"
    calls = [f"(say {_quoted(text)} {_quoted(str(path))})" for text, path in zip(texts, paths, strict=True)]
    script.write_text("\n".join([f"(voice_{voice})", SPEAKING, *calls, ""]), encoding="utf-8")
    printed = program_output(["festival", "-b", str(script)], PACKAGE, len(texts), folder=folder)
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


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


FESTIVAL = Synthesiser("festival", PACKAGE, _voices, _synthesise, ARPABET_PHONES)
