"""``lipmotion cite``: what to cite, as BibTeX."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.terminal.printing import print_lines


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("cite", help="print what to cite, as BibTeX: lipmotion, an engine's papers, a corpus")
    what = "a model file, an engine, or a citation key; default: the model that ships with the package"
    parser.add_argument("name", nargs="?", metavar="NAME", help=what)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the BibTeX entries for a model, an engine or a citation key."""
    from lipmotion.pipeline.model import shipped_path

    print_lines(citations(options.name or str(shipped_path())))


def citations(name: str) -> str:
    """Return the BibTeX entries for a model file, an engine or a citation key.

    Raises InputError: there is nothing of that name.  Raises ModelFormatError: the file is not a model.
    """
    from lipmotion.citations import bibliography, engine_citations, model_citations
    from lipmotion.engines import ENGINES
    from lipmotion.errors import InputError
    from lipmotion.pipeline.model import read_header

    if name in ENGINES.names:
        return engine_citations(name)
    if name in bibliography():
        return bibliography()[name]
    if not Path(name).exists():
        known = ", ".join((*ENGINES.names, *bibliography()))
        raise InputError(f"nothing to cite is called {name!r}; give a model file, or one of: {known}")
    return model_citations(read_header(Path(name)))
