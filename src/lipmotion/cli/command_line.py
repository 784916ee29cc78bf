"""The parser of the command line, and the execution of one command."""

from __future__ import annotations

import argparse
import io
import logging
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from lipmotion.cli.arguments.declared import check_paths
from lipmotion.cli.arguments.options import Version
from lipmotion.cli.terminal.events import Events, Stopper
from lipmotion.cli.terminal.printing import flush_output, print_error, print_usage
from lipmotion.errors import ExportError, LipMotionError
from lipmotion.extensions import Registry
from lipmotion.types.values import parse_number, parse_whole

_VERBS = "animate batch live speak render edit explain cues train"
_PLACES = {name: f"lipmotion.cli.verbs.{name}:add" for name in _VERBS.split()}
_PLACES |= {name: f"lipmotion.cli.verbs.about:add_{name}" for name in "addon info cite doctor completion".split()}
_PLACES["words"] = "lipmotion.cli.verbs.explain:add_words"
_PLACES["adapt"] = "lipmotion.cli.verbs.train:add_adapt"
VERBS: Registry[Callable[[Any], None]] = Registry("verb", "lipmotion.verbs", _PLACES)
"""What adds each verb to the parser; those of faces, studio and lab are entry points."""
MIN_LIKENESS = 0.7
"""So alike must an option be to one that does not exist to be suggested: ``--force`` is not meant by ``--voice``."""
NUMBER = re.compile(r"-(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?$")  # a negative number, which is no option
EXIT_CODES = """exit codes: 0 done, 1 a bug (doctor: a broken part), 2 wrong command line, 3 unusable input, 4 corpus,
5 alignment, 6 model file, 7 output, 8 missing package, 130 interrupted, 143 terminated"""


def run(words: Sequence[str], stopper: Stopper, events: Events) -> None:
    """Parse and run one command; without a word, print the help.

    words : of the command line, without the program's name
    Raises whatever the command raises; WrongCommandLineError: it cannot be parsed; SystemExit: help was asked for.
    """
    if sys.stdout is None:
        raise ExportError("standard output is closed; open it, or send it to a file or to /dev/null")
    handler, python_warnings = logging.Handler(), logging.getLogger("py.warnings")
    handler.emit = lambda record: print_error(f"warning: {record.getMessage()}")  # type: ignore[method-assign]
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
    show_before = warnings.showwarning
    # of Python or of another package, so that it is printed as one printable line
    warnings.showwarning = lambda message, *_, **__: python_warnings.warning("%s", message)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal may not know every letter of a file's name
    try:
        options = parse_words(words or ["--help"], argparse.Namespace(stopper=stopper, events=events, words=words))
        events.start(options)
        check_paths(options)
        options.run(options)
        stopper.settle()
    finally:
        warnings.showwarning = show_before
        flush_output()


def parse_words(words: Sequence[str], options: argparse.Namespace) -> argparse.Namespace:
    """Return the options, over those of a job file and a level. Raises WrongCommandLineError."""
    verb = next((word for word in words if not word.startswith("-")), None)
    program = parser([name for name in VERBS.names if name == verb])
    words = _put_positionals_first(program, words)
    empty = argparse.Namespace(**vars(options))
    options, unknown = program.parse_known_args(words, options)
    if getattr(options, "job", None) or getattr(options, "detail", None):  # what they say are the defaults by now
        options, unknown = program.parse_known_args(words, empty)
    if unknown:
        _verbs(program)[options.verb].error(f"unrecognized arguments: {' '.join(unknown)}")
    return options


def parser(names: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Return the parser with the verbs that are named, or with all."""
    program = _Parser(
        prog="lipmotion",
        description="Speech in, lip motion out, with models trained from your own recordings.",
        epilog=EXIT_CODES,
    )
    program.add_argument("--version", action=Version, nargs=0, help="print the version")
    verbs = program.add_subparsers(title="verbs", dest="verb", required=True, metavar="VERB")
    for name in names or VERBS.names:
        VERBS.load(name)(verbs)
    return program


def _verbs(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of the verbs of a parser, by name; none where it has none."""
    actions = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return dict(next((action.choices for action in actions), {}))


def _put_positionals_first(parser: argparse.ArgumentParser, words: Sequence[str]) -> list[str]:
    """Return the words of a command with those that belong to no option first: argparse takes them in one place alone.

    Of ``-o OUT RECORDING`` argparse would take the recording for an output, too. If no word stands elsewhere, the last
    one is the recording, and so are those before it that exist and end alike, where a verb takes several.
    Raises WrongCommandLineError: no such verb, and which is most like it; an option that the verb has not.
    """
    verb, verbs = next((at for at, word in enumerate(words) if not word.startswith("-")), len(words)), _verbs(parser)
    if verb < len(words) and verbs:
        if words[verb] not in verbs:
            near = get_close_matches(words[verb], verbs, n=1)
            hint = f"did you mean: {parser.prog} {near[0]}" if near else f"the verbs are: {', '.join(verbs)}"
            parser.error(f"no verb {words[verb]!r}; {hint}")
        return [*words[: verb + 1], *_put_positionals_first(verbs[words[verb]], words[verb + 1 :])]
    known, moved, taken, at = parser._option_string_actions, list[int](), list[int](), 0
    words = [  # "-o OUT" may be one word, as for Rhubarb
        part for word in words for part in (word.split(maxsplit=1) if word.partition(" ")[0] in known else (word,))
    ]
    while at < len(words) and words[at] != "--":
        option, at = _find_option(parser, words[at]), at + 1
        is_apart = "=" not in words[at - 1] and (words[at - 1].startswith("--") or words[at - 1] in known)
        if option is None:
            moved.append(at - 1)
        elif option.nargs == "+" and is_apart:
            behind = next((end for end in range(at, len(words)) if _is_option(words[end])), len(words))
            taken, at = list(range(at + 1, behind)), behind
        elif option.nargs is None and is_apart:
            at += 1
    positional = next((action for action in parser._actions if not action.option_strings), None)
    if at == len(words) and not moved and positional is not None and taken and "--job" not in words:
        moved = _find_recordings(positional, words, taken)
    return [*(words[each] for each in moved), *(word for each, word in enumerate(words) if each not in moved)]


def _find_recordings(positional: argparse.Action, words: Sequence[str], taken: Sequence[int]) -> list[int]:
    """Return the places of the words that an option took from its verb: the last one, and files of that suffix."""
    last, end = words[taken[-1]], Path(words[taken[-1]]).suffix
    if positional.nargs == "?" and end and " " not in last:
        return []
    alike = [each for each in taken if Path(words[each]).suffix == end and Path(words[each]).exists()]
    return sorted({taken[-1], *(alike if positional.nargs == "+" else ())})


def _is_option(word: str) -> bool:
    """Return whether argparse takes a word for an option: not a pipe, a negative number, or words with a space."""
    return word.startswith("-") and word != "-" and " " not in word and not NUMBER.match(word)


def _find_option(parser: argparse.ArgumentParser, word: str) -> argparse.Action | None:
    """Return what an option means; None: the word is none. Raises WrongCommandLineError: the parser has none so."""
    if not _is_option(word):
        return None
    name, known = word.partition("=")[0], parser._option_string_actions
    if name in known or (not word.startswith("--") and word[:2] in known):
        return known.get(name) or known[word[:2]]
    longer = [option for option in known if word.startswith("--") and option.startswith(name)]
    if longer:
        return known[longer[0]]
    stems = {option.lstrip("-"): option for option in known if option.startswith("--")}
    near = get_close_matches(name.lstrip("-"), stems, n=1, cutoff=MIN_LIKENESS)
    return parser.error(f"unrecognized arguments: {word}" + (f"; did you mean {stems[near[0]]}?" if near else ""))


class WrongCommandLineError(LipMotionError):
    """The command line cannot be parsed."""

    exit_code = 2


class _Parser(argparse.ArgumentParser):
    """Raises an error for a wrong command line, as one line that says where help is; reports help it cannot print."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._negative_number_matcher = NUMBER
        self.register("type", int, parse_whole)
        self.register("type", float, partial(parse_number, finite=False))

    def error(self, message: str) -> NoReturn:
        for kind, required in (("float", "a number, such as 1.5"), ("int", "a whole number")):
            message = message.replace(f": invalid {kind} value: ", f": required {required}, not ")
        raise WrongCommandLineError(f"{message}{'' if message.endswith('?') else ';'} see: {self.prog} --help")

    def _print_message(self, message: str, file: Any = None) -> None:
        print_usage(message, is_wanted=file is sys.stdout)
