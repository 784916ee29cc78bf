"""Installs the package as strangers would, animates, and writes ``docs/results/figures/release.json``.

    python scripts/release_matrix.py python3.10 python3.12 … [--folder WORK]

The wheel is built from the source archive, and once more from the tree: both must be the same bytes. Each Python gets
an empty environment: the wheel comes from an index in a folder, the rest from pip's own. Then ``examples/welcome.flac``
becomes a video, and ``doctor`` looks at all. In the environment of the last Python, what other systems lack is taken
away, one after the other. Processor seconds are of all processes of a step: other work does not change them.
Needs ``build`` and ``twine``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]
SHEET = ROOT / "docs" / "results" / "figures" / "release.json"
SOUND = ROOT / "examples" / "welcome.flac"
NO_FORK = "import os\nfor name in ('fork', 'forkpty'):\n    delattr(os, name)\n"
FOREIGN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "cp1252"}


def run(*command: object, **variables: str) -> tuple[str, float, float]:
    """Return what a command printed, its seconds and its processor seconds. Raises CalledProcessError: it failed."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, encoding="utf-8", errors="replace", check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **variables},
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout + done.stderr, time.perf_counter() - start, used


def build(folder: Path) -> Path:
    """Build and check both archives; return an index of them. Ends the program: the two wheels differ."""
    run(sys.executable, "-m", "build", "-o", folder / "dist", ROOT)
    run(sys.executable, "-m", "build", "--wheel", "-o", folder / "tree", ROOT)
    run(sys.executable, "-m", "twine", "check", "--strict", *(folder / "dist").iterdir())
    (wheel,), (again,) = (folder / "dist").glob("*.whl"), (folder / "tree").glob("*.whl")
    if hashlib.sha256(wheel.read_bytes()).digest() != hashlib.sha256(again.read_bytes()).digest():
        sys.exit("the wheel of the source archive is another one than that of the tree")
    page = folder / "index" / "lipmotion" / "index.html"
    page.parent.mkdir(parents=True)
    page.write_text(f'<a href="{wheel.as_uri()}">{wheel.name}</a>', encoding="utf-8")
    return folder / "index"


def install(python: str, folder: Path, index: Path) -> tuple[Path, list[str]]:
    """Install into a new environment and animate; return its Python, and the row of the table."""
    run(python, "-m", "venv", folder)
    inner = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    pip = (inner, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-cache-dir")
    _, first_s, first = run(*pip, "--no-deps", "--index-url", index.as_uri(), "lipmotion")
    _, rest_s, rest = run(*pip, "lipmotion")
    _, video_s, video = run(inner, "-m", "lipmotion", "animate", SOUND, "-o", folder / "welcome.mp4")
    version, *_ = run(inner, "-c", "import platform; print(platform.python_version())")
    return inner, [
        version.strip(), f"{first + rest:.0f}", f"{video:.0f}", f"{first_s + rest_s + video_s:.0f}", look(inner),
    ]  # fmt: skip


def look(python: Path, **variables: str) -> str:
    """Return what ``doctor`` finds broken, or absent apart from extras; it fails where something is broken."""
    code = "import sys; from lipmotion.cli.main import main; main() and None"
    printed, *_ = run(python, "-c", code, "doctor", **variables)
    rows = [(line[:8].strip(), line[8:29].strip()) for line in printed.splitlines()]
    found = [name if state == "absent" else f"{name} broken" for state, name in rows if state in {"absent", "broken"}]
    return ", ".join(name for name in found if not name.startswith("[")) or "–"


def simulate(python: Path, folder: Path) -> list[list[str]]:
    """Return a row for each thing that another system lacks: what it is, what ``doctor`` says, and what was made."""
    rows, shared = [], folder / "é ü"
    shared.mkdir()
    for name in ("a", "ö"):
        (shared / f"{name}.flac").write_bytes(SOUND.read_bytes())
    (folder / "site").mkdir()
    (folder / "site" / "sitecustomize.py").write_text(NO_FORK, encoding="utf-8")
    batch = (python, "-m", "lipmotion", "batch", shared, "--to", "json,cues.tsv", "--jobs", "2", "--recogniser", "fast")
    for title, variables in (
        ("no `fork`, two processes", {"PYTHONPATH": str(folder / "site")}),
        ("a console in cp1252, a locale without UTF-8, `PYTHONUTF8=0`, paths with é ü", FOREIGN),
    ):
        *_, used = run(*batch, "--out", folder / f"out {len(rows)}", **variables)
        rows.append([title, "–", f"batch, {used:.0f} s"])
    for package in ("hama", "numba"):
        run(python, "-m", "pip", "uninstall", "--quiet", "--yes", package)
        animate = ("animate", SOUND, "-o", folder / f"without {package}.mp4")
        *_, used = run(python, "-m", "lipmotion", *animate)
        rows.append([f"no {package}", look(python), f"video, {used:.0f} s"])
    return rows


def main() -> None:
    """Measure, and write the sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pythons", nargs="+")
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    folder = options.folder or Path(tempfile.mkdtemp())
    index, found = build(folder), []
    for number, python in enumerate(options.pythons):
        inner, row = install(python, folder / str(number), index)
        found.append(row)
        print(*row, sep=" | ", flush=True)
    simulated = simulate(inner, folder)
    commit, *_ = run("git", "-C", ROOT, "rev-parse", "--short", "HEAD")
    stamp = {"commit": commit.strip(), "date": date.today().isoformat(), "model": "none"}
    stamp |= {"command": "python scripts/release_matrix.py python3.10 python3.11 python3.12 python3.13"}
    sheet = json.loads(SHEET.read_text(encoding="utf-8"))
    sheet["tables"]["installed"] |= {**stamp, "rows": found}
    sheet["tables"]["simulated"] |= {**stamp, "rows": simulated}
    SHEET.write_text(json.dumps(sheet, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
