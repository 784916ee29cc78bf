"""``lipmotion speak``: text to speech of a synthetic voice, with the lip motion for it."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.arguments.declared import add_options, add_outputs, pick_part
from lipmotion.cli.arguments.options import add_machine_readable, add_verb
from lipmotion.cli.terminal.progress import Report, report_progress
from lipmotion.pipeline.job import Job, check_outputs, open_face, write_job_outputs
from lipmotion.pipeline.request import Request
from lipmotion.printable import printable
from lipmotion.storage.sources import is_file, read_text_file
from lipmotion.types.progress import sub_monitor


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "speak", run)
    add_options(parser, Request, "lexicon", "model", "speaker", "onto", "onto_speaker", "pauses", "asymmetry")
    suffixes = "FILE.mp4 .webm .mov %%05d.png .wav .flac .ogg .json .csv .npz .TextGrid .vtt, ... (docs/formats.md)"
    add_outputs(parser, suffixes, required=False)
    add_machine_readable(parser)
    parser.set_defaults(wrong=parser.error)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.speak`` and ``lipmotion.write``; print the paths that were written, or the installed voices."""
    if options.voices == bool(options.output):
        options.wrong("required: -o FILE, or --voices")
    if not options.voices and (options.words is None) == (options.text is None):
        options.wrong("required: a text, or --text FILE, not both")
    if options.words is not None and is_file(Path(options.words)):
        options.wrong(f"{options.words} is the name of a file; to say what is in it: --text {options.words}")

    with report_progress(options) as report:
        if options.voices:
            from lipmotion.speech.voices.installed import list_voices

            voices = [{"name": voice.full_name, "language": voice.language} for voice in list_voices()]
            text = "\n".join(f"{voice['name']:28} {voice['language']}" for voice in voices)
            report.finish(text or "no voice is installed", voices=voices)
        else:
            _speak(options, report)


def _speak(options: argparse.Namespace, report: Report) -> None:
    from lipmotion.corpora import Corpus
    from lipmotion.pipeline.analysis.read_request import read_lexicon
    from lipmotion.pipeline.generate.speak import LARGEST_TEXT_BYTES, speak
    from lipmotion.pipeline.model import load_model

    job = pick_part(options, Job())
    face = open_face(job.outputs)
    check_outputs(job, face)
    request, text = job.request, options.words
    if options.text:
        text = read_text_file(options.text, "text", LARGEST_TEXT_BYTES)
    model, corpus = load_model(request.model), Corpus.open(options.corpus) if options.corpus else None
    sound, result = speak(
        text,
        voice=options.voice,
        corpus=corpus,
        model=model,
        lexicon=read_lexicon(request) if request.lexicon else None,
        speaker=request.speaker,
        onto=request.onto or face.find_other_person(model, request.speaker),
        onto_speaker=request.onto_speaker,
        pauses=request.pauses,
        asymmetry=request.asymmetry,
        monitor=sub_monitor(report.receive, 0.0, 0.5),
    )
    write_job_outputs(job, face, result, sound, model=model, monitor=sub_monitor(report.receive, 0.5, 1.0))
    report.finish("\n".join(map(printable, options.output)), files=options.output, seconds=round(sound.duration_s, 3))
