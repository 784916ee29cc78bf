"""The parser of the command line, and the execution of one command."""

from __future__ import annotations

import argparse
import io
import logging
import sys
import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

from lipmotion.cli.arguments.paths import check_paths
from lipmotion.cli.terminal.events import Events
from lipmotion.cli.terminal.outcome import one_line
from lipmotion.cli.terminal.printing import flush_output, print_line, print_usage, with_program_name
from lipmotion.cli.terminal.stop import Stopper
from lipmotion.cli.verbs import (
    adapt,
    addon,
    animate,
    batch,
    character,
    cite,
    compare,
    completion,
    corpus,
    cues,
    doctor,
    edit,
    evaluate,
    experiment,
    explain,
    face,
    info,
    render,
    speak,
    studio,
    study,
    train,
    words,
)
from lipmotion.errors import ExportError

VERBS = (
    *(animate, batch, speak, render, edit, studio, explain, cues, words, corpus, train, adapt, face),
    *(character, addon, evaluate, compare, experiment, study, info, cite),
    *(doctor, completion),
)
OF_OTHER_TOOLS = {
    **dict.fromkeys(("convert", "export", "import", "draw", "video", "play"), "render IN -o OUT"),
    **dict.fromkeys(("generate", "lipsync", "sync", "process", "run", "infer", "predict"), "animate SPEECH -o OUT"),
    "align": "animate SPEECH --transcript TEXT -o OUT.TextGrid",
    **dict.fromkeys(("say", "tts", "synthesize", "synthesise"), "speak TEXT -o OUT"),
    **dict.fromkeys(("transcribe", "recognize", "recognise"), "words SPEECH"),
    **dict.fromkeys(("visemes", "mouth"), "cues SPEECH -o OUT"),
    **dict.fromkeys(("finetune", "fine-tune"), "adapt"),
    **dict.fromkeys(("check", "validate", "lint"), "batch --check LIST"),
    **dict.fromkeys(("setup", "install", "status"), "doctor"),
    **{name: f"--{name}" for name in ("version", "help")},
}
"""Words that do in other programs what verbs do here."""
EXIT_CODES = """exit codes: 0 done, 1 a bug (doctor: a broken part), 2 wrong command line, 3 unusable input, 4 corpus,
5 alignment, 6 model file, 7 output, 8 missing package, 130 interrupted, 143 terminated"""


def run(arguments: Sequence[str] | None, stopper: Stopper, events: Events) -> None:
    """Parse and run one command.

    arguments : words of the command line without the program's name; None: those of the process
    Raises whatever the command raises; SystemExit: help was asked for, or the command line is wrong.
    """
    if sys.stdout is None:
        raise ExportError("standard output is closed; open it, or send it to a file or to /dev/null")
    _log_warnings_as_lines()
    show_before, warnings.showwarning = warnings.showwarning, _log_warning
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal may not know every letter of a file's name
    try:
        words = list(sys.argv[1:] if arguments is None else arguments)
        options = _parsed(parser(), words, argparse.Namespace(stopper=stopper, events=events, words=words))
        events.start(options)
        check_paths(options)
        options.run(options)
        stopper.settle()
    finally:
        warnings.showwarning = show_before
        flush_output()


def parser() -> argparse.ArgumentParser:
    """Return the parser with all verbs."""
    whole = _Parser(
        prog="lipmotion",
        description="Speech in, lip motion out, with models trained from your own recordings.",
        epilog=EXIT_CODES,
    )
    whole.add_argument("--version", action=_Version, nargs=0, help="print the version")
    verbs = whole.add_subparsers(title="verbs", dest="verb", required=True, metavar="VERB")
    for verb in VERBS:
        verb.add(verbs)
    return whole


def _parsed(
    whole: argparse.ArgumentParser, arguments: Sequence[str] | None, options: argparse.Namespace
) -> argparse.Namespace:
    """Return the options, over those of a job file and a level; of a misspelt one the error names the nearest."""
    _check_verb(whole, sys.argv[1:] if arguments is None else arguments)
    empty = argparse.Namespace(**vars(options))
    options, unknown = whole.parse_known_args(arguments, options)
    if getattr(options, "job", None) or getattr(options, "detail", None):  # what they say are the defaults by now
        options, unknown = whole.parse_known_args(arguments, empty)
    if unknown:
        option = next((word for word in unknown if word.startswith("-")), unknown[0]).split("=")[0]
        near = get_close_matches(option, _option_strings(whole, options.verb), n=1)
        hint = f"did you mean {near[0]}?" if near else f"see: {whole.prog} {options.verb} --help"
        whole.error(f"unrecognized arguments: {' '.join(unknown)}; {hint}")
    return options


def _check_verb(whole: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """End with an error if the first word is no verb; it names the verb that is meant, by other tools' words, too."""
    word = next((word for word in words if not word.startswith("-")), None)
    (verbs,) = (action.choices for action in whole._actions if isinstance(action, argparse._SubParsersAction))
    if word is None or word in verbs:
        return
    near = get_close_matches(word, verbs, n=1)
    usual = "animate SPEECH -o OUT" if Path(word).suffix else ""
    meant = OF_OTHER_TOOLS.get(word.lower(), near[0] if near else usual)
    hint = f"did you mean: {whole.prog} {meant}" if meant else f"the verbs are: {', '.join(verbs)}"
    whole.error(f"no verb {word!r}; {hint}")


def _option_strings(parser: argparse.ArgumentParser, verb: str = "") -> list[str]:
    """Return the long options of a parser and of its verbs; of one verb, if it is named."""
    found: list[str] = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, part in action.choices.items():
                found += _option_strings(part) if verb in {"", name} else []
        else:
            found += [option for option in action.option_strings if option.startswith("--")]
    return found


class _Parser(argparse.ArgumentParser):
    """Reports a wrong command line as one printable line, and help that cannot be printed."""

    def error(self, message: str) -> NoReturn:
        super().error(one_line(message))

    def _print_message(self, message: str, file: Any = None) -> None:
        print_usage(message, is_wanted=file is sys.stdout)


class _Version(argparse.Action):
    """Prints the version, which is looked up only when the option is given."""

    def __call__(self, *_: object) -> None:
        from lipmotion.extensions import installed_version

        print_line(f"lipmotion {installed_version()}")
        sys.exit(0)


class _WarningFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return with_program_name(f"warning: {record.getMessage()}")


def _log_warning(message: object, *_: object, **__: object) -> None:
    """Log a warning of Python or of another package, so that it is printed as one printable line."""
    logging.getLogger("py.warnings").warning("%s", message)


def _log_warnings_as_lines() -> None:
    """Print each logged warning as one line on standard error."""
    handler = logging.StreamHandler()
    handler.setFormatter(_WarningFormatter())
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
