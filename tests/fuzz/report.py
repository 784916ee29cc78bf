"""What a run found, as a table and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fuzz.campaign import Tally
from fuzz.judge import CRASH, HANG, MEMORY, READ, REFUSED, WRONG

OTHERS = tuple(kind for kind in WRONG if kind not in (CRASH, HANG, MEMORY))


def row(tally: Tally) -> dict[str, Any]:
    """Return the figures of one reader."""
    counts = {name: tally.kinds[kind] for name, kind in {"read": READ, "refused": REFUSED}.items()}
    wrong = {"crashes": tally.kinds[CRASH], "hangs": tally.kinds[HANG], "memory": tally.kinds[MEMORY]}
    rate = round(tally.distinct / tally.seconds, 1) if tally.seconds else 0.0
    return {
        **{"reader": tally.reader, "tried": tally.made, "distinct": tally.distinct, **counts, **wrong},
        **{"errors": sum(tally.kinds[kind] for kind in OTHERS), "defects": len(tally.findings)},
        **{"kept": tally.kept, "lines": len(tally.lines), "per_s": rate, "slowest_s": round(tally.slowest_s, 1)},
    }


def table(tallies: Sequence[Tally]) -> str:
    """Return all readers, and their sum, as lines of columns."""
    rows = [row(tally) for tally in tallies]
    whole = {key: sum(one[key] for one in rows) for key in rows[0] if key != "reader"} if rows else {}
    whole |= {
        "slowest_s": max((one["slowest_s"] for one in rows), default=0.0),
        "per_s": round(whole.get("per_s", 0.0), 1),
    }
    rows.append({"reader": "all", **whole})
    texts = [list(rows[0]), *([str(value) for value in one.values()] for one in rows)]
    widths = [max(len(line[i]) for line in texts) for i in range(len(texts[0]))]
    return "\n".join("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in texts)


def write_json(path: Path, tallies: Sequence[Tally], seed: int, minutes: float) -> None:
    """Write the same for a program, every defect with its trace."""
    found = [
        {"reader": tally.reader, "kind": finding.result.kind, "where": finding.result.where, "inputs": finding.count}
        | {"detail": finding.result.detail}
        for tally in tallies
        for finding in tally.findings.values()
    ]
    whole = {"seed": seed, "minutes": minutes, "readers": [row(tally) for tally in tallies], "defects": found}
    path.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
