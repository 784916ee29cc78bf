"""Verbs about lipmotion itself: ``addon``, ``cite``, ``completion``, ``doctor``, ``info``."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Mapping
from functools import cache, partial
from importlib import resources
from pathlib import Path
from typing import Any

from lipmotion.cli.arguments.options import add_machine_readable, add_verb
from lipmotion.cli.terminal.printing import print_line, print_lines
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.errors import InputError, LipMotionError
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types.progress import Item

LIPMOTION, EIGENLIPS, ADAPTATION, GRID = "lipmotion", "xieliu2007", "gales1998", "cooke2006"
"""Keys of the software itself, of the methods of eigenlips and of adaptation, and of the GRID corpus."""
ENGINE_KEYS: Mapping[str, list[str]] = {
    row["engine"]: row["keys"].split() for row in read_shipped_table("lipmotion", "engine_citations.csv")
}
"""Keys of the papers that each built-in engine implements, with its default options."""


@cache
def bibliography() -> Mapping[str, str]:
    """Return all BibTeX entries by citation key, in the order of ``citations.bib``."""
    text = (resources.files("lipmotion") / "citations.bib").read_text(encoding="utf-8")
    entries = [entry.strip() for entry in re.split(r"^(?=@)", text, flags=re.MULTILINE) if entry.strip()]
    return {entry[entry.index("{") + 1 : entry.index(",")]: entry for entry in entries}


def list_engine_citations(name: str, *more: str, owners: Iterable[str] = ()) -> str:
    """Return the BibTeX entries of lipmotion, of an engine's papers, and of further keys.

    Remarks name other owners of recordings, and say of another package's engine where to find what to cite.
    """
    remarks = [f"% recordings: {owner}" for owner in owners]
    if name not in ENGINE_KEYS:
        remarks.insert(0, f"% the engine {name!r} comes with another package: cite what its documentation names")
    keys = dict.fromkeys((LIPMOTION, *ENGINE_KEYS.get(name, ()), *more))
    return "\n\n".join([*(bibliography()[key] for key in keys), *remarks])


def list_model_citations(header: Mapping[str, Any]) -> str:
    """Return the BibTeX entries of lipmotion, of a model's engine and methods, and of the corpus that it learned from.

    header : of a model file. Recordings other than those of GRID are named in a BibTeX comment
    """
    attribution = header.get("attribution") or []
    attribution = attribution if isinstance(attribution, list) else [attribution]
    owners = [" ".join(str(owner).split()) for owner in attribution]
    others = [owner for owner in owners if "GRID corpus" not in owner]
    keys = [EIGENLIPS] if header.get("visual", "geometry") != "geometry" else []
    keys += [ADAPTATION] if "adapted" in header else []
    keys += [GRID] if len(others) < len(owners) else []
    return list_engine_citations(str(header.get("engine")), *keys, owners=others)


OF_PRIOR = ("engine", "corpus", "split", "utterances", "minutes", "licence", "attribution")
"""What ``info`` prints of the model on which a model stands and which is part of its file."""


def _run_addon(options: argparse.Namespace) -> None:
    from lipmotion.formats.game_engines import write_addon

    write_addon(options.program, options.output)
    print_line(options.output)


def _run_cite(options: argparse.Namespace) -> None:
    """Print the entries. Raises InputError: nothing has that name.  Raises ModelFormatError: the file is no model."""
    from lipmotion.engines import ENGINES
    from lipmotion.pipeline.model import find_shipped, read_header

    name = options.name or str(find_shipped())
    if name in ENGINES.names:
        print_lines(list_engine_citations(name))
    elif name in bibliography():
        print_lines(bibliography()[name])
    elif Path(name).exists():
        print_lines(list_model_citations(read_header(Path(name))))
    else:
        known = ", ".join((*ENGINES.names, *bibliography()))
        raise InputError(f"nothing to cite is called {name!r}; give a model file, or one of: {known}")


def _run_completion(options: argparse.Namespace) -> None:
    import shtab

    from lipmotion.cli.command_line import parser

    program = parser()
    parsers = [program]
    for action in (action for each in parsers for action in each._actions):
        if isinstance(action, argparse._SubParsersAction):
            parsers += action.choices.values()
        elif action.choices is None and action.nargs != 0:  # a file may be the value
            action.complete = shtab.FILE  # type: ignore[attr-defined] # where shtab looks for it
    print_lines(shtab.complete(program, shell=options.shell).removesuffix("\n"))


def add_doctor(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb that prints what is installed, what is missing, and whether the main path works."""
    add_machine_readable(add_verb(verbs, __package__, "doctor", _run_doctor))


def _run_doctor(options: argparse.Namespace) -> None:
    """Print what is found, one line for each part. Raises LipMotionError, of exit code 1: something is broken."""
    from lipmotion.cli.doctor import doctor

    broken = []
    with report_progress(options) as report:
        for each in doctor():
            if options.machine_readable:
                report.receive(Item(each.name, each.state, each.text))
            else:
                print_line(f"{each.state:7} {each.name:20} {each.text}")
            broken += [each.name] if each.state == "broken" else []
        if broken:
            raise LipMotionError(f"broken: {', '.join(broken)}; what to do is said above")
        report.finish("all that is needed works", broken=broken)


def add_info(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb that prints the header of a model, or its decision trees."""
    add_verb(verbs, __package__, "info", run_info)


def run_info(options: argparse.Namespace) -> None:
    """Print the header of the model, or its trees."""
    from lipmotion.pipeline.model import find_shipped, load_model, read_header

    path = options.model or find_shipped()
    if options.structure:
        model = load_model(path)
        text = model.engine.describe(model.learned)
        if not text:
            raise InputError(f"models of the engine {model.engine.name!r} have no trees; leave --structure out")
        print_lines(text)
        return
    header = read_header(path)
    print_line(f"{'file':14} {path} ({path.stat().st_size / 1e6:.1f} MB)")
    inside = header.pop("prior", None)
    for name, value in header.items():
        print_line(f"{name:14} {_plain(value) or 'none stated'}")
    for name, value in (inside or {}).items():
        if name in OF_PRIOR and value:
            print_line(f"prior {name:12} {_plain(value)}")


def _plain(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}={item}" for key, item in value.items())
    return "; ".join(map(str, value)) if isinstance(value, list) else str(value)


add_addon = partial(add_verb, package=__package__, verb="addon", run=_run_addon)
add_cite = partial(add_verb, package=__package__, verb="cite", run=_run_cite)
add_completion = partial(add_verb, package=__package__, verb="completion", run=_run_completion)
