"""``lipmotion corpus prepare|info|motion|sync|offset|prompts|coverage``: make a corpus of recordings, correct it."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.options import add_arguments, add_machine_readable, add_workers, list_or_all
from lipmotion.cli.terminal.printing import print_error, print_json, print_line
from lipmotion.errors import shorten_list
from lipmotion.pipeline.request import Request


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its actions to the parser of the command line."""
    parser = verbs.add_parser("corpus", help="prepare recordings for training")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    for name, (run, text) in ACTIONS.items():
        action = actions.add_parser(name, help=text)
        add_arguments(action, __package__, f"corpus {name}")
        action.set_defaults(run=run)
    add_workers(actions.choices["prepare"])
    add_machine_readable(actions.choices["prepare"])
    add_options(actions.choices["prompts"], Request, "lexicon")
    add_options(actions.choices["coverage"], Request, "lexicon")


def run_prepare(options: argparse.Namespace) -> None:
    """Call ``lipmotion.prepare``; report what was prepared, kept and skipped."""
    from lipmotion.cli.terminal.progress import report_progress
    from lipmotion_faces.corpus.prepare import prepare

    with report_progress(options) as report:
        done = prepare(
            options.recordings,
            options.output,
            workers=options.workers,
            crops=options.crops,
            offset_ms=options.offset_ms,
            monitor=report.receive,
        )
        report.finish(str(done), corpus=str(done.corpus), kind=done.kind, **done.counts)


def run_info(options: argparse.Namespace) -> None:
    """Print the summary of ``lipmotion.Corpus``, and by how much its sound is late."""
    from lipmotion.corpora import Corpus
    from lipmotion_faces.corpus.sync import measure_offsets

    corpus = Corpus.open(options.corpus)
    offsets = [("offset", line) for line in measure_offsets(corpus).list_lines()]
    for name, value in (*corpus.summary().items(), *offsets):
        print_line(f"{name:12} {value}")


def run_motion(options: argparse.Namespace) -> None:
    """Write the tracked motion of every recording of a list as ``FOLDER/NAME.json``."""
    from lipmotion.corpora import Corpus
    from lipmotion.formats.base import write_motion
    from lipmotion.pipeline.outputs.motion_files import as_generation
    from lipmotion.storage.files import make_folder
    from lipmotion.types import Timeline

    corpus, chosen = Corpus.open(options.corpus), [name for name in options.channels.split(",") if name]
    tracked = {}
    for name in corpus.required(list_or_all(options.split)):
        utterance = corpus.utterance(name)
        motion = utterance.track.motion.selected(chosen) if chosen else utterance.track.motion
        tracked[name] = as_generation(motion, utterance.phones or Timeline(()))
    make_folder(options.output)
    for name, generation in tracked.items():
        write_motion(options.output / f"{name}.json", generation, source={"tracked": name}, model={})
    print_line(f"{options.output}: the motion of {len(tracked)} recordings")


def run_sync(options: argparse.Namespace) -> None:
    """Call ``lipmotion_faces.corpus.sync.remove_offsets``; print by how much the sound was moved."""
    from lipmotion.corpora import Corpus
    from lipmotion_faces.corpus.sync import remove_offsets

    corpus = Corpus.open(options.corpus)
    moved = remove_offsets(corpus)
    for collection, late_s in moved.items():
        print_line(f"{collection or corpus.path}: sound moved by {-1000 * late_s:+.0f} ms")
    if not moved:
        print_line(f"{corpus.path}: nothing moved: the sound is in step, or its offset could not be measured")


def run_offset(options: argparse.Namespace) -> None:
    """Call ``measure_offset``; print the offset and how alike the sounds are."""
    from lipmotion.speech.sound.audio_files import read_audio
    from lipmotion_faces.corpus.sound_offset import measure_offset

    offset = measure_offset(read_audio(options.camera), read_audio(options.recorder))
    print_line(f"--offset-ms {offset.late_s * 1000:.1f}  (levels correlate by {offset.alike:.2f})")


def run_prompts(options: argparse.Namespace) -> None:
    """Call ``prompts`` and print the sentences, each with the phones and diphones covered so far."""
    from lipmotion.corpora import Corpus
    from lipmotion.pipeline.training.prompts import prompts
    from lipmotion.units import Lexicon

    have = Corpus.open(options.have) if options.have else None
    lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
    selection = prompts(options.text, count=options.count, have=have, lexicon=lexicon)
    for number, prompt in enumerate(selection.chosen, 1):
        covered = f"phones {prompt.phones:2}/{selection.phones}  diphones {prompt.diphones:4}/{selection.diphones}"
        print_line(f"{number:4}  {covered}  {prompt.text}")
    last = selection.chosen[-1] if selection.chosen else None
    covered = f"{last.diphones / selection.diphones:.0%} of all their diphones" if last else "they add nothing"
    print_line(f"{len(selection.chosen)} of {selection.sentences} sentences: {covered}")
    if selection.left_out:
        words = sorted(set(selection.left_out.values()))
        some = shorten_list(words, 10)
        print_error(f"warning: left out {len(selection.left_out)} sentences for their words: {some}")


def run_coverage(options: argparse.Namespace) -> None:
    """Call ``measure_coverage`` and print it."""
    from lipmotion.corpora import Corpus
    from lipmotion.units import Lexicon
    from lipmotion_faces.corpus.coverage import coverage_to_json, format_coverage, measure_coverage

    lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
    result = measure_coverage(Corpus.open(options.corpus), options.text, lexicon=lexicon)
    if options.json:
        print_json(coverage_to_json(result))
    else:
        for line in format_coverage(result, max(options.count, 0)):
            print_line(line)
    if result.left_out and not options.json:
        print_error(f"warning: left out {len(result.left_out)} sentences for their words (--json has them)")
    if result.unknown and not options.json:
        print_error(f"warning: {result.unknown} utterances without known words or phones were not counted")


ACTIONS = {
    "prepare": (run_prepare, "make a corpus of recordings"),
    "info": (run_info, "print what a corpus contains"),
    "motion": (run_motion, "write tracked motion as files: to draw, or for a study"),
    "sync": (run_sync, "correct the offset between sound and lips of a corpus"),
    "offset": (run_offset, "measure by how much a separate recording of the sound is late"),
    "prompts": (run_prompts, "print sentences to record, those that cover most sounds first"),
    "coverage": (run_coverage, "print which sounds a corpus lacks, and what is nearest to them"),
}
"""What each action runs, and does; its arguments stand in ``arguments.csv``."""
