"""Options of the command line from their declarations in the parts of a job, and the parts from what was given."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.errors import InputError
from lipmotion.pipeline.job import DETAILS, Job
from lipmotion.pipeline.request import Outputs
from lipmotion.types.configuration import Configuration, kind_of
from lipmotion.types.delivery import Delivery, Staging

PartT = TypeVar("PartT", bound=Configuration)
OF_ANIMATE = ("posteriors", "kinds")
"""Outputs that other verbs do not write."""


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
        flags = _flags(each)
        if not seen.intersection(flags):
            _add(parser, flags, each, changes.get(each.name, {}))
        seen.update(flags)


def add_outputs(parser: argparse.ArgumentParser, files: str, *, required: bool = True) -> None:
    """Add the outputs, what is written to them, and how.

    files    : the suffixes that are possible, for the help
    required : whether there must be an output
    """
    add_options(parser, Outputs, but=OF_ANIMATE, files={"help": files, "required": required})
    add_options(parser, Staging)
    add_options(parser, Delivery)
    add_detail(parser)


def add_detail(parser: argparse.ArgumentParser) -> None:
    """Add ``--detail``: options of a level of detail. What the command line says is ahead of them."""
    told = "film: all; game, mobile: fewer frames, keys and curves (docs/controls.md#levels-of-detail)"
    parser.add_argument("--detail", choices=tuple(DETAILS), action=_Detail, help=told)


def add_job_file(parser: argparse.ArgumentParser) -> None:
    """Add ``--job``: options from a file. What the command line says is ahead of it."""
    told = "options from a TOML file; those that are given here are ahead of it (docs/api.md)"
    add_input(parser, "--job", what="job file", action=_JobFile, metavar="FILE.toml", help=told)
    parser.set_defaults(start=Job())


def part_of(options: argparse.Namespace, start: PartT, **given: Any) -> PartT:
    """Return a job, or a part of one, with what was given on the command line.

    start : what has the values that the verb has no options for
    given : values of fields, ahead of the options
    Raises InputError: a value that is not allowed.
    """
    for each in fields(start):
        value = getattr(start, each.name)
        if each.name in given:
            continue
        if isinstance(value, Configuration):
            given[each.name] = part_of(options, value)
        elif "help" in each.metadata and hasattr(options, _name(each)):
            found = getattr(options, _name(each))
            given[each.name] = _moves(each, found) if "still" in each.metadata else found
    return replace(start, **given)


def _moves(each: Field[Any], still: str) -> bool:
    """Return whether something moves. Raises InputError: the list of what is still names something else."""
    names = [other.name for other in fields(Staging) if "still" in other.metadata]
    listed = [name for name in still.split(",") if name]
    unknown = [name for name in listed if name not in names]
    if unknown:
        raise InputError(f"{each.metadata['still']} names {unknown[0]!r}, required some of: {', '.join(names)}")
    return each.name not in listed


def _flags(each: Field[Any]) -> tuple[str, ...]:
    usual = each.metadata.get("still", "--" + each.name.replace("_", "-"))
    flags: tuple[str, ...] = each.metadata.get("flags", (usual,))
    return flags


def _name(each: Field[Any]) -> str:
    """Return the name of an option among those that were parsed."""
    return _flags(each)[-1].lstrip("-").replace("-", "_")


def _add(parser: argparse.ArgumentParser, flags: tuple[str, ...], each: Field[Any], changes: Mapping[str, Any]) -> None:
    told, kind = each.metadata, kind_of(each)
    how: dict[str, Any] = {"default": each.default, "type": kind}
    how |= {name: told[name] for name in ("help", "metavar") if name in told}
    if told["rule"].choices:
        how["choices"] = told["rule"].choices
    if "still" in told:
        how |= {"default": "", "type": str}
    elif kind is bool:
        how = {"action": "store_true", "help": told["help"]}
    elif kind is tuple and "writes" in told:
        how |= {"type": str, "nargs": "+", "action": _Collected}
    elif kind is tuple:
        how["type"] = _listed
    how |= changes
    if "reads" in told:
        of_input = {name: told[name] for name in ("replaceable", "default_path") if name in told}
        add_input(parser, *flags, what=told["reads"], **of_input, **how)
    elif "writes" in told:
        add_output(parser, *flags, force="-o" in flags, **how)
    else:
        parser.add_argument(*flags, **how)


def _listed(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


class _Collected(argparse.Action):
    """Appends what is given, once or several times; the default is not among it."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *given: Any) -> None:  # noqa: ARG002
        before = getattr(namespace, self.dest)
        setattr(namespace, self.dest, [*(() if before is self.default else before), *given[0]])


class _JobFile(argparse.Action):
    """Makes the options of a file the defaults; for those the command line is parsed again."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *given: Any) -> None:
        path: Path = given[0]
        setattr(namespace, self.dest, path)
        job = Job.from_file(path)
        parser.set_defaults(start=job)
        _make_defaults(parser, job)


class _Detail(argparse.Action):
    """Makes the options of a level of detail the defaults; for those the command line is parsed again."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *given: Any) -> None:
        setattr(namespace, self.dest, given[0])
        _make_defaults(parser, DETAILS[given[0]])


def _make_defaults(parser: argparse.ArgumentParser, job: Job) -> None:
    """Make the options of a job that are not as usual the defaults of a parser."""
    defaults = dict(_given(job))
    for action in parser._actions:
        if action.dest in defaults and action.default != defaults[action.dest]:
            action.default, action.required = defaults[action.dest], False


def _given(part: Configuration) -> Iterator[tuple[str, Any]]:
    """Yield name and value of every option that is not as usual."""
    for each in fields(part):
        value = getattr(part, each.name)
        if isinstance(value, Configuration):
            yield from _given(value)
        elif {"help", "still"} & {*each.metadata} == {"help"} and value != each.default:
            yield _name(each), value
    if isinstance(part, Staging):
        still = [each.name for each in fields(part) if "still" in each.metadata and not getattr(part, each.name)]
        yield "still", ",".join(still)
