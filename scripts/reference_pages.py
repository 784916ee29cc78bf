"""Writes the lists of the reference that follow from the code: verbs, formats, limits, bad input.

In a page such a list stands between ``<!--made:NAME-->`` and ``<!--end-->``. Run
``python scripts/reference_pages.py`` after a change of the command line or of a registry.
``--check`` writes nothing, and fails where something would change.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
REGION = re.compile(r"(<!--made:([\w-]+)-->\n).*?(<!--end-->)", re.DOTALL)
SEE = {
    "animate": "faces controls formats transcripts meshes filmed-face",
    "batch": "batch",
    "live": "live",
    "speak": "speak",
    "render": "controls",
    "edit": "edit",
    "studio": "studio",
    "explain": "explain",
    "cues": "cues",
    "words": "start",
    "corpus": "corpora",
    "train": "own-model unit-sets voices long-work",
    "adapt": "adaptation",
    "face": "filmed-face consent",
    "character": "meshes",
    "addon": "formats",
    "evaluate": "measures",
    "compare": "compare",
    "league": "results/league",
    "experiment": "report measures",
    "study": "study study-analysis",
    "info": "start",
    "cite": "glossary",
    "doctor": "start",
    "completion": "verbs",
}
"""The pages on each verb, without suffix."""


def verbs(parser: argparse.ArgumentParser, before: str = "") -> Iterator[tuple[str, str, argparse.ArgumentParser]]:
    """Yield name, help and parser of every verb, and of the actions of verbs that have some."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, part in action.choices.items():
                inner = list(verbs(part, f"{before}{name} "))
                yield from inner or [(before + name, helps.get(name, ""), part)]


def shown(action: argparse.Action) -> str:
    """Return an option, or an argument, as one types it."""
    names = action.option_strings
    value = action.metavar or (action.dest.upper() if not action.choices else "|".join(map(str, action.choices)))
    value = " ".join(dict.fromkeys(value)) if isinstance(value, tuple) else value
    value += "…" if action.nargs in ("+", "*") else ""
    if not names:
        value = value.upper() if value.islower() else value
        return f"[{value}]" if action.nargs == "?" else value
    name = "-o" if "-o" in names else next(name for name in names if name.startswith("--"))
    return name if action.nargs == 0 else f"{name} {value}"


def whole_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    from lipmotion.cli.command_line import parser

    return parser()


def actions(part: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the arguments and options of a verb but for ``--help`` and hidden ones."""
    return [action for action in part._actions if action.dest != "help" and action.help != argparse.SUPPRESS]


def verb_list() -> str:
    """Return the list of all verbs: what they must be given, what they do, and, once a verb, the pages on it."""
    lines, pages = [], dict(SEE)
    for name, says, part in verbs(whole_parser()):
        needed = [shown(a) for a in actions(part) if not a.option_strings or a.required]
        see = ", ".join(f"[{page}]({page}.md)" for page in pages.pop(name.split()[0], "").split())
        lines.append(f"- `{' '.join([name, *needed])}`: {says}" + (f" ({see})" if see else ""))
    return "\n".join(lines)


def exit_codes() -> str:
    """Return the exit codes as the command line lists them."""
    return re.sub(r"\s+", " ", whole_parser().epilog or "").capitalize() + "."


def line_on(name: str, module: str) -> str:
    """Return what a module's docstring says of a format, in the line that begins with its name."""
    found = re.search(rf"^``\.?{re.escape(name)}``: (.*)$", import_module(module).__doc__ or "", re.MULTILINE)
    return found[1].rstrip(".") if found else ""


def motion_formats() -> str:
    """Return the list of motion files that are built in, and which are only written."""
    from lipmotion.formats.base import MOTION_FORMATS

    lines, only_written = [], []
    for name in MOTION_FORMATS.names:
        chosen = MOTION_FORMATS.load(name)
        says = line_on(name, chosen.write.__module__)
        says += f"; {chosen.rate_hz:g} frames a second" if chosen.rate_hz else ""
        lines.append(f"- `.{name}`: {says}")
        only_written += [] if chosen.read else [f"`.{name}`"]
    return "\n".join([*lines, "", f"Not read back: {', '.join(only_written)}."])


def cue_formats() -> str:
    """Return the list of cue files."""
    from lipmotion.formats.cues import CUE_FORMATS

    return "\n".join(f"- `.{name}`: {line_on(name, form.text.__module__)}" for name, form in CUE_FORMATS.items())


def character_limits() -> str:
    """Return what the files of a character may hold."""
    from lipmotion_faces.characters.file_limits import ALLOWANCE

    return "At most " + ", ".join(f"{most:,} {what}" for what, most in ALLOWANCE.items()) + "."


def bad_input() -> str:
    """Return the groups of bad input that are tested, with the number of command lines of each."""
    text = (ROOT / "tests" / "robustness" / "table.md").read_text(encoding="utf-8")
    groups = (part.partition("\n") for part in text.split("\n### ")[1:])
    return "; ".join(f"{name.lower()} {rows.count(chr(10) + '| ') - 1}" for name, _, rows in groups) + "."


TABLES: dict[str, Callable[[], str]] = {
    "verbs": verb_list,
    "exit-codes": exit_codes,
    "motion-formats": motion_formats,
    "cue-formats": cue_formats,
    "character-limits": character_limits,
    "bad-input": bad_input,
}


def written(text: str) -> str:
    """Return a page with its tables as the code has them. Raises KeyError: there is no table of a name."""
    return REGION.sub(lambda match: f"{match[1]}{TABLES[match[2]]()}\n{match[3]}", text)


def main() -> int:
    """Write all pages; with ``--check`` none. Return 1 where a page differed."""
    wrong = 0
    for page in sorted(DOCS.rglob("*.md")):
        before = page.read_text(encoding="utf-8")
        after = written(before)
        if after == before:
            continue
        if "--check" in sys.argv:
            print(f"{page.relative_to(ROOT)}: not as the code has it")
            wrong = 1
        else:
            page.write_text(after, encoding="utf-8")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
