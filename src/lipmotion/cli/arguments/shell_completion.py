"""Completion of the command line by shells: scripts for bash, zsh and fish that follow from the parser.

Bash and zsh share one function of the POSIX shell that prints what may follow the words before the cursor; where it
prints nothing, a file is meant.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

SHARED = """_lipmotion_candidates() {
    local current=$1 place='' last='' word
    shift
    for word in "$@"; do
        case "$place/$word" in
            @PLACES@) place=$place/$word ;;
        esac
        last=$word
    done
    case "$place $last" in
@VALUES@
    esac
    case "$current" in
        -*)
            case "$place" in
@OPTIONS@
            esac ;;
        *)
            case "$place" in
@NEXT@
            esac ;;
    esac
}
"""
BASH = (
    SHARED
    + """_lipmotion() {
    local current=${COMP_WORDS[COMP_CWORD]}
    local before=("${COMP_WORDS[@]:1:COMP_CWORD-1}")
    COMPREPLY=($(compgen -W "$(_lipmotion_candidates "$current" "${before[@]}")" -- "$current"))
}
complete -o bashdefault -o default -F _lipmotion lipmotion
"""
)
ZSH = (
    "#compdef lipmotion\n"
    + SHARED
    + """_lipmotion() {
    local -a before found
    before=("${(@)words[2,CURRENT-1]}")
    found=($(_lipmotion_candidates "${words[CURRENT]}" "$before[@]"))
    if (( $#found )); then compadd -a found; else _files; fi
}
if [[ $funcstack[1] = _lipmotion ]]; then _lipmotion "$@"; else compdef _lipmotion lipmotion; fi
"""
)
FISH = """function __lipmotion_at
    set -l place
    for word in (commandline -opc)[2..-1]
        contains -- /(string join -- / $place $word) @PLACES@; and set -a place $word
    end
    test "$place" = "$argv"
end
"""


class CommandPlace(NamedTuple):
    """A place in the command line: of the program itself, of a verb, or of an action of a verb.

    path    : the verb and the action that lead there
    options : long and short options, with their help and what may be their value; None: they take none
    next    : what may stand there that is no option, with its help
    """

    path: tuple[str, ...]
    options: tuple[tuple[tuple[str, ...], str, tuple[str, ...] | None], ...]
    next: tuple[tuple[str, str], ...]

    @property
    def name(self) -> str:
        """The path as the scripts write it: ``/corpus/prepare``; of the program itself, nothing."""
        return "".join(f"/{word}" for word in self.path)

    @property
    def quoted(self) -> str:
        """The name as a pattern of a ``case``."""
        return shlex.quote(self.name)


def places(parser: argparse.ArgumentParser, path: tuple[str, ...] = ()) -> Iterator[CommandPlace]:
    """Yield all places of a command line, those that hold others first."""
    options, following = [], []
    parts: list[tuple[str, argparse.ArgumentParser]] = []
    for action in parser._actions:
        told = action.help or ""
        if isinstance(action, argparse._SubParsersAction):
            parts += action.choices.items()
            following += [(choice.dest, choice.help or "") for choice in action._choices_actions]
        elif action.option_strings and action.help != argparse.SUPPRESS:
            values = None if action.nargs == 0 else tuple(map(str, action.choices or ()))
            options.append((tuple(action.option_strings), told % {"default": action.default} if told else "", values))
        elif action.choices:
            following += [(str(choice), told) for choice in action.choices]
    yield CommandPlace(path, tuple(options), tuple(following))
    for name, part in parts:
        yield from places(part, (*path, name))


def script(shell: str, parser: argparse.ArgumentParser) -> str:
    """Return the script that makes a shell complete the command line; ``shell``: one of ``SHELLS``."""
    return SHELLS[shell](list(places(parser)))


def _posix(frame: str, found: list[CommandPlace]) -> str:
    """Return a script with the tables of the shared function."""
    values = []
    for place in found:
        for names, _, allowed in place.options:
            if allowed:
                pattern = "|".join(shlex.quote(f"{place.name} {name}") for name in names)
                values.append(_case(pattern, allowed, "; return"))
    options = [_case(place.quoted, (name for names, *_ in place.options for name in names)) for place in found]
    following = [_case(place.quoted, (name for name, _ in place.next)) for place in found if place.next]
    tables = {"VALUES": values, "OPTIONS": options, "NEXT": following}
    for name, lines in tables.items():
        frame = frame.replace(f"@{name}@", "\n".join(lines))
    return frame.replace("@PLACES@", "|".join(place.name for place in found if place.path))


def _case(pattern: str, words: Iterable[str], end: str = "") -> str:
    """Return a line of a ``case`` that prints words."""
    return f"        {pattern}) echo {shlex.quote(' '.join(words))}{end} ;;"


def _bash(found: list[CommandPlace]) -> str:
    return _posix(BASH, found)


def _zsh(found: list[CommandPlace]) -> str:
    return _posix(ZSH, found)


def _fish(found: list[CommandPlace]) -> str:
    """Return a script of one line for each option, and for each word that may stand where no option does."""
    lines = []
    for place in found:
        start = f"complete -c lipmotion -n {_fish_word(' '.join(['__lipmotion_at', *place.path]))}"
        lines += [f"{start} -f -a {_fish_word(name)} -d {_fish_word(told)}" for name, told in place.next]
        for names, told, values in place.options:
            flags = " ".join(f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in names)
            value = "" if values is None else f" -x -a {_fish_word(' '.join(values))}" if values else " -r"
            lines.append(f"{start} {flags}{value} -d {_fish_word(told)}")
    return FISH.replace("@PLACES@", " ".join(place.name for place in found if place.path)) + "\n".join(lines) + "\n"


def _fish_word(text: str) -> str:
    """Return a text as one word of fish."""
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"


SHELLS: dict[str, Callable[[list[CommandPlace]], str]] = {"bash": _bash, "zsh": _zsh, "fish": _fish}
"""What writes the script of each shell."""
