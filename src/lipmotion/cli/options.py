"""Options that several verbs have."""

from __future__ import annotations

import argparse


def add_machine_readable(parser: argparse.ArgumentParser) -> None:
    """Add ``--machine-readable`` (docs/long-work.md)."""
    parser.add_argument(
        "--machine-readable", action="store_true", help="one JSON object a line on standard output, and nothing else"
    )


def list_or_all(split: str) -> str | None:
    """Return the list that ``--split`` names; None for ``all``."""
    return None if split == "all" else split


def numbers(text: str) -> list[int]:
    """Return whole numbers with commas between them."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}; required: numbers with commas between them") from error
