"""Options of the command line from their declarations in the parts of a job, and the parts from what was given."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from lipmotion.cli.terminal.printing import write_bytes
from lipmotion.errors import InputError
from lipmotion.pipeline.job import DETAILS, Job
from lipmotion.pipeline.request import Outputs
from lipmotion.storage.sources import Source, check_apart, is_folder
from lipmotion.types.configuration import Configuration, kind_of
from lipmotion.types.delivery import Delivery, Staging


class InputArgument(NamedTuple):
    """An argument that names an input file or folder; ``name``: of the option in the namespace."""

    name: str
    what: str  # a noun for it, in messages
    replaceable: bool  # it is read completely before anything is written, so that an output may replace it
    is_text: bool  # it may be a text instead of a path: a folder of that name is then not an input
    default_path: Callable[[], Path] | None  # returns the input that is read where the argument is left out


class OutputArgument(NamedTuple):
    """An argument that names an output file or folder."""

    name: str
    is_folder: bool
    keeps_work: bool  # finished stages are kept in a folder beside it (``locks.keep_unfinished``)


def add_input(
    parser: argparse.ArgumentParser,
    *names: str,
    what: str,
    replaceable: bool = False,
    default_path: Callable[[], Path] | None = None,
    **more: Any,
) -> None:
    """Add an argument that names an input, with the further arguments of ``add_argument``."""
    kind = Path if what != "corpus" else lambda text: text if "://" in text else Path(text)
    action = parser.add_argument(*names, **({"type": kind} | more))
    _declare(parser, "reads", InputArgument(action.dest, what, replaceable, action.type is str, default_path))


def add_output(
    parser: argparse.ArgumentParser,
    *names: str,
    is_folder: bool = False,
    keeps_work: bool = False,
    force: bool = False,
    **more: Any,
) -> None:
    """Add an argument that names an output, with the further arguments of ``add_argument``.

    force : also add the option ``--force``
    """
    action = parser.add_argument(*names, **({"type": Path} | more))
    _declare(parser, "writes", OutputArgument(action.dest, is_folder, keeps_work))
    if force:
        replacing = "let an output replace a text, units or model file that is read; never a recording or a corpus"
        parser.add_argument("--force", action="store_true", help=replacing)


def check_paths(options: argparse.Namespace) -> None:
    """Raise ExportError if an output of a command is one of its inputs."""
    from lipmotion.storage.locks import name_work_folder

    declared: tuple[OutputArgument, ...] = getattr(options, "writes", ())
    written = [(output, path) for output in declared for path in _paths(getattr(options, output.name))]
    if not written:
        return
    folders = [path for output, path in written if output.is_folder]
    folders += [name_work_folder(path) for output, path in written if output.keeps_work]
    files, sources = [path for output, path in written if not output.is_folder], list[Source]()
    for argument in getattr(options, "reads", ()):
        paths = _paths(getattr(options, argument.name))
        paths = paths or ([argument.default_path()] if argument.default_path else [])
        inputs = [path for path in paths if not (argument.is_text and is_folder(path))]
        sources += [Source(path, argument.what, argument.replaceable) for path in inputs]
    check_apart(files, sources, folders=folders, force=getattr(options, "force", False))


def _paths(value: Any) -> list[Path]:
    """Return the values of an argument as paths; none where it was left out."""
    values = value if isinstance(value, list | tuple) else [value]
    return [Path(text) for text in values if text is not None]


def _declare(parser: argparse.ArgumentParser, kind: str, argument: InputArgument | OutputArgument) -> None:
    """Append a declaration to the parser's default ``reads`` or ``writes``."""
    parser.set_defaults(**{kind: (*(parser.get_default(kind) or ()), argument)})


PIPE = "-"
OPENED = ("/dev/fd/", "/dev/stdin", "/proc/self/fd/")  # where pipes are that the shell has opened for this process
LARGEST_RECORDING_BYTES = 1 << 32  # most bytes of a recording from a pipe
BLOCK = 1 << 20
FORMATS = ("json", "csv")


def add_pipe_format(parser: argparse.ArgumentParser) -> None:
    """Add ``--format``: of motion on standard output."""
    parser.add_argument("--format", choices=FORMATS, default="json", help="of '-o -', standard output (default: json)")


def is_pipe(path: Path | str) -> bool:
    """Return whether a path is ``-``, or a pipe that the shell has opened (``/dev/stdin``, ``<(...)``).

    Not a named pipe: nobody may ever write to it.
    """
    return str(path) == PIPE or (str(path).startswith(OPENED) and Path(path).is_fifo())


@contextmanager
def read_pipe(path: Path) -> Iterator[Path]:
    """Yield the path of a recording; what comes through a pipe is stored in a temporary file.

    Raises InputError: nothing comes, or more than ``LARGEST_RECORDING_BYTES`` bytes.
    """
    if not is_pipe(path):
        yield path
        return
    from lipmotion.storage.locks import open_temporary

    with open_temporary() as folder:
        stored = folder / "standard-input"
        if str(path) == PIPE and sys.stdin is None:
            raise InputError("standard input is closed; required: a recording, as of 'ffmpeg ... -f wav -'")
        size, opened = 0, nullcontext(sys.stdin.buffer) if str(path) == PIPE else path.open("rb")
        with opened as source, stored.open("wb") as target:
            while block := source.read(BLOCK):
                size += target.write(block)
                if size > LARGEST_RECORDING_BYTES:
                    most = f"more than {LARGEST_RECORDING_BYTES} bytes"
                    raise InputError(f"{most} come through the pipe; save the recording as a file first")
        if not size:
            raise InputError("nothing comes through the pipe; required: a recording, as of 'ffmpeg ... -f wav -'")
        yield stored


@contextmanager
def write_pipe(options: argparse.Namespace) -> Iterator[tuple[tuple[str, ...], bool]]:
    """Let ``-`` among the outputs be a temporary file, and write it to standard output at the end.

    Yields the outputs, and whether standard output is one of them; then nothing else may be printed there.
    """
    outputs = tuple(options.output)
    if PIPE not in outputs:
        yield outputs, False
        return
    from lipmotion.storage.locks import open_temporary

    with open_temporary() as folder:
        motion = folder / f"motion.{options.format}"
        yield tuple(str(motion) if output == PIPE else output for output in outputs), True
        write_bytes(motion)


PartT = TypeVar("PartT", bound=Configuration)


def add_options(
    parser: argparse.ArgumentParser,
    part: type[Configuration],
    *names: str,
    but: Sequence[str] = (),
    **changes: Mapping[str, Any],
) -> None:
    """Add options of a part.

    names   : which fields, in this order; none: all but those of ``but``
    changes : by the name of a field, what a verb says of it otherwise: arguments of ``add_argument``
    """
    known = {each.name: each for each in fields(part) if "help" in each.metadata}
    seen: set[str] = set()
    for each in map(known.__getitem__, names or (name for name in known if name not in but)):
        flags = _list_flags(each)
        if not seen.intersection(flags):
            _add(parser, flags, each, changes.get(each.name, {}))
        seen.update(flags)


def add_outputs(parser: argparse.ArgumentParser, files: str, *, required: bool = True) -> None:
    """Add the outputs, what is written to them, and how.

    files    : the suffixes that are possible, for the help
    required : whether there must be an output
    """
    add_options(parser, Outputs, but=("kinds",), files={"help": files, "required": required})
    add_options(parser, Staging)
    add_options(parser, Delivery)
    add_detail(parser)


def add_detail(parser: argparse.ArgumentParser) -> None:
    """Add ``--detail``: options of a level of detail. What the command line says is ahead of them."""
    text = "film: all; game, mobile: fewer frames, keys and curves (docs/controls.md#levels-of-detail)"
    parser.add_argument("--detail", choices=tuple(DETAILS), action=_Defaults, help=text)


def add_job_file(parser: argparse.ArgumentParser) -> None:
    """Add ``--job``: options from a file. What the command line says is ahead of it."""
    text = "options from a TOML file; those given here override it (docs/api.md)"
    add_input(parser, "--job", what="job file", action=_Defaults, metavar="FILE.toml", help=text)
    parser.set_defaults(start=Job())


def pick_part(options: argparse.Namespace, start: PartT, **values: Any) -> PartT:
    """Return a job, or a part of one, with the options of the command line.

    start  : what has the values that the verb has no options for
    values : of fields, ahead of the options
    Raises InputError: a value that is not allowed.
    """
    for each in fields(start):
        part = getattr(start, each.name)
        if each.name in values:
            continue
        if isinstance(part, Configuration):
            values[each.name] = pick_part(options, part)
        elif "help" in each.metadata and hasattr(options, _name(each)):
            value = getattr(options, _name(each))
            values[each.name] = _moves(each, value) if "still" in each.metadata else value
    return replace(start, **values)


def _moves(each: Field[Any], still: str) -> bool:
    """Return whether something moves. Raises InputError: the list of what is still names something else."""
    names = [other.name for other in fields(Staging) if "still" in other.metadata]
    listed = [name for name in map(str.strip, still.split(",")) if name]
    unknown = [name for name in listed if name not in names]
    if unknown:
        raise InputError(f"{each.metadata['still']} names {unknown[0]!r}, required some of: {', '.join(names)}")
    return each.name not in listed


def _list_flags(each: Field[Any]) -> tuple[str, ...]:
    usual = each.metadata.get("still", "--" + each.name.replace("_", "-"))
    flags: tuple[str, ...] = each.metadata.get("flags", (usual,))
    return flags


def _name(each: Field[Any]) -> str:
    return _list_flags(each)[-1].lstrip("-").replace("-", "_")


def _add(parser: argparse.ArgumentParser, flags: tuple[str, ...], each: Field[Any], changes: Mapping[str, Any]) -> None:
    about, kind = each.metadata, kind_of(each)
    how: dict[str, Any] = {"default": each.default, "type": kind}
    how |= {name: about[name] for name in ("help", "metavar") if name in about}
    if about["rule"].choices:
        how["choices"] = about["rule"].choices
    if "still" in about:
        how |= {"default": "", "type": str}
    elif kind is bool:
        how = {"action": "store_true", "help": about["help"]}
    elif kind is tuple and "writes" in about:
        how |= {"type": str, "nargs": "+", "action": _Collected}
    elif kind is tuple:
        how["type"] = lambda text: tuple(text.split(","))
    how |= changes
    if "reads" in about:
        of_input = {name: about[name] for name in ("replaceable", "default_path") if name in about}
        add_input(parser, *flags, what=about["reads"], **of_input, **how)
    elif "writes" in about:
        add_output(parser, *flags, force="-o" in flags, **how)
    else:
        parser.add_argument(*flags, **how)


class _Collected(argparse.Action):
    """Appends what is given, once or several times; the default is not among it."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *values: Any) -> None:  # noqa: ARG002
        before = getattr(namespace, self.dest)
        setattr(namespace, self.dest, [*(() if before is self.default else before), *values[0]])


class _Defaults(argparse.Action):
    """Makes the options of a job file, or of a level of detail, the defaults; the command line is parsed again then."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *values: Any) -> None:
        setattr(namespace, self.dest, values[0])
        job = DETAILS[values[0]] if self.choices else Job.from_file(values[0])
        if not self.choices:
            parser.set_defaults(start=job)
        defaults = dict(_list_set(job))
        for action in parser._actions:
            if action.dest in defaults and action.default != defaults[action.dest]:
                action.default, action.required = defaults[action.dest], False


def _list_set(part: Configuration) -> Iterator[tuple[str, Any]]:
    """Yield name and value of every option that has not its default."""
    for each in fields(part):
        value = getattr(part, each.name)
        if isinstance(value, Configuration):
            yield from _list_set(value)
        elif {"help", "still"} & {*each.metadata} == {"help"} and value != each.default:
            yield _name(each), value
    if isinstance(part, Staging):
        still = [each.name for each in fields(part) if "still" in each.metadata and not getattr(part, each.name)]
        yield "still", ",".join(still)
