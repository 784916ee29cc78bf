"""Installs the package as strangers would, animates, and writes ``docs/results/figures/release.json``.

    python scripts/release_matrix.py WORK python3.10 python3.12 … [--collect] [--simulate]

WORK/dist holds both archives, built by ``python -m build -o WORK/dist`` and checked by ``twine check --strict``. With
``--collect``, the wheel and all that it or an extra needs come into WORK/wheels, for all Pythons; the pins of
``make demo`` are downloaded, too. Without it there is no network: pip has that folder alone. Each Python gets an empty
environment, in which ``examples/welcome`` becomes a video as in ``make demo``; then come the extras, one after the
other, of which each package is imported; then the video again. Rows of other Pythons stay as they are. ``--simulate``
takes away, in the environment of the last Python, what other systems lack; it needs Linux and ``unshare``.

Processor seconds are of all processes of a step: other work does not change them. The parts of the first video are
differences: the second one finds compiled kernels, a motion alone draws nothing, and what a command imports is
imported again, and nothing else done.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import time
from datetime import date
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
SHEET = ROOT / "docs" / "results" / "figures" / "release.json"
WELCOME = ROOT / "examples" / "welcome.flac"
FOREIGN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "cp1252"}
LIKE_WINDOWS = {"PYTHONPATH": str(ROOT / "scripts" / "like_windows")}
READ_ONLY = (
    'for place in "$HOME" "$0"; do mount --bind "$place" "$place"; mount -o remount,bind,ro "$place"; done; exec "$@"'
)
IMPORT_ALL = """
import sys
from importlib import import_module
for name in sys.argv[1:]:
    try:
        import_module(name)
    except ImportError:
        pass
"""
IMPORT_EXTRA = """
import re, sys
from importlib import import_module, metadata
from lipmotion.cli.doctor import doctor, list_requirements
row = next(each for each in doctor() if each.name == f"[{sys.argv[1]}]")
if row.state != "works":
    sys.exit(row.text)
plain = lambda name: re.sub(r"[-_.]+", "-", name).lower()
wanted = {plain(each.name) for each in list_requirements() if f'extra == "{sys.argv[1]}"' in str(each.marker)}
for module, packages in metadata.packages_distributions().items():
    if module.isidentifier() and not module.startswith("_") and wanted & set(map(plain, packages)):
        import_module(module)
"""


class FailedError(Exception):
    """A command failed; its text is what it printed."""


def run(*command: object, **variables: str) -> tuple[str, float, float]:
    """Return what a command printed, its processor seconds and its seconds. Raises FailedError."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, encoding="utf-8", errors="replace", check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **variables},
    )  # fmt: skip
    if done.returncode:
        raise FailedError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}".strip())
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout + done.stderr, used, time.perf_counter() - start


class Environment:
    """An environment of one Python that installs from a folder of wheels, and what is made there."""

    def __init__(self, python: str, work: Path) -> None:
        version, *_ = run(python, "-c", "import platform; print(platform.python_version())")
        self.version, self.work = version.strip(), work
        self.folder, self.made = work / f"python-{self.version}", work / f"made-{self.version}"
        run(python, "-m", "venv", "--clear", self.folder)
        self.made.mkdir(exist_ok=True)
        self.python = self.folder / "bin" / "python"

    def collect(self) -> None:
        """Put the wheel, and all that it or an extra needs, into the folder of wheels: the one step with a network."""
        pip, wheels = (self.python, "-m", "pip"), self.work / "wheels"
        (wheel,) = (self.work / "dist").glob("*.whl")
        pins = ("--no-deps", "--require-hashes", "-r", ROOT / "requirements" / "core.txt")
        run(*pip, "download", *pins, "--dest", self.work / "pins")
        for extra in ("", *extras()):
            wanted = f"lipmotion[{extra}] @ {wheel.as_uri()}".replace("[]", "")
            try:
                run(*pip, "wheel", "--use-pep517", "--wheel-dir", wheels, "--find-links", wheels, wanted)
            except FailedError as failure:  # it fails again where it is installed
                print(failure)

    def install(self, *wanted: str) -> tuple[str, float, float]:
        """Install from the folder of wheels alone; return as ``run``."""
        settings = {"PIP_CONFIG_FILE": os.devnull, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(self.work / "wheels")}
        return run(self.python, "-m", "pip", "install", "--no-compile", *wanted, **settings)

    def animate(
        self, *outputs: str, face: str = "head", before: tuple[object, ...] = (), **variables: str
    ) -> tuple[str, float, float]:
        """Animate the welcome as ``make demo`` does; return as ``run``."""
        options = ("--transcript", WELCOME.with_suffix(".txt"), "--face", face, "--force")
        files = [self.made / name for name in outputs]
        return run(
            *before, self.python, "-m", "lipmotion", "animate", WELCOME, *options, "-o", *files, **variables
        )  # fmt: skip

    def batch(self, *, before: tuple[object, ...] = (), **variables: str) -> tuple[str, float, float]:
        """Animate two recordings with foreign names in two processes; return as ``run``."""
        sounds, out = self.made / "é 日本", self.made / "out"
        shutil.rmtree(out, ignore_errors=True)
        for name in ("a", "ö"):
            sounds.mkdir(exist_ok=True)
            shutil.copy(WELCOME, sounds / f"{name}.flac")
        options = ("--to", "json,cues.tsv", "--jobs", "2", "--recogniser", "fast", "--out", out)
        done = run(*before, self.python, "-m", "lipmotion", "batch", sounds, *options, **variables)
        files = sorted(path.name for path in out.glob("*.*") if path.stem[0] in "aö")
        if files != ["a.cues.tsv", "a.json", "ö.cues.tsv", "ö.json"]:
            raise FailedError(f"batch wrote {files}")
        return done

    def look(self, *, before: tuple[object, ...] = (), **variables: str) -> str:
        """Return what ``doctor`` finds broken, or absent apart from extras."""
        try:
            printed, *_ = run(*before, self.python, "-m", "lipmotion", "doctor", **variables)
        except FailedError as failure:
            printed = str(failure)
        rows = [(line[:8].strip(), line[8:29].strip()) for line in printed.splitlines()]
        found = dict.fromkeys(f"{name} {state}" for state, name in rows if state in {"absent", "broken"})
        if "main path" not in printed:
            found = {"doctor ended early": None}
        return ", ".join(each for each in found if not each.startswith("[")) or "all works"


def extras() -> list[str]:
    """Return the names of the extras that ``pyproject.toml`` declares."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return re.findall(r"^([\w-]+) = \[", text.split("[project.optional-dependencies]")[1].split("\n[")[0], re.MULTILINE)


def measure(place: Environment) -> list[float]:
    """Install and animate; return the processor seconds of each part of the way to the first video."""

    def imports_again(profile: str) -> float:
        return run(place.python, "-c", IMPORT_ALL, *re.findall(r"\| +([\w.]+)$", profile, re.MULTILINE))[1]

    _, install, install_s = place.install("lipmotion")
    (library,) = (place.folder / "lib").glob("python*")
    _, compiling, compiling_s = run(place.python, "-m", "compileall", "-q", library)
    _, first, first_s = place.animate("welcome.mp4", "welcome.json")
    profile, second, _ = place.animate("welcome.mp4", "welcome.json", PYTHONPROFILEIMPORTTIME="1")
    short_profile, motion, _ = place.animate("welcome.json", PYTHONPROFILEIMPORTTIME="1")
    imports, motion_imports = imports_again(profile), imports_again(short_profile)
    drawing = second - imports - (motion - motion_imports)
    print(place.version, f"first video after {install_s + compiling_s + first_s:.0f} s by the clock", flush=True)
    return [install, compiling, imports, first - second, motion - motion_imports, drawing]


def install_extras(place: Environment) -> str:
    """Install one extra after the other, then animate; return those of which a package is absent or not imported."""
    fails = []
    for extra in extras():
        try:
            place.install(f"lipmotion[{extra}]")
            run(place.python, "-c", IMPORT_EXTRA, extra)
        except FailedError as failure:
            print(place.version, extra, str(failure).splitlines()[-1], sep=" | ", flush=True)
            fails.append(extra)
    place.animate("extras.mp4")
    print(place.version, place.look(), flush=True)
    return ", ".join(fails) or "–"


def simulate(place: Environment) -> list[list[str]]:
    """Return a row for each thing that another system lacks: what it is, seconds, and what ``doctor`` says of it."""
    rows: list[list[str]] = []
    usual = place.look()

    def make(title: str, face: str = "head", **options: Any) -> None:
        try:
            made = f"{place.animate('simulated.mp4', face=face, **options)[1]:.0f} s"
            place.batch(**options)
        except FailedError as failure:
            print(failure, flush=True)
            made = "refused" if str(failure).splitlines()[-1].startswith("lipmotion: error:") else "failed"
        found = [each.rpartition(" ")[0] for each in place.look(**options).split(", ") if each not in usual]
        rows.append([title, made, ", ".join(found) or "–"])
        print(*rows[-1], sep=" | ", flush=True)

    make("Windows: no `fork`, POSIX", **LIKE_WINDOWS)
    make("UTF-8: cp1252, ASCII", **FOREIGN)
    for package, face in (("hama", "head"), ("numba", "woman"), ("pocketsphinx", "head")):
        run(place.python, "-m", "pip", "uninstall", "--yes", package)
        make(package if face == "head" else f"{package}; usual face", face)
        place.install("lipmotion")
    for cache in place.folder.rglob("__pycache__"):
        shutil.rmtree(cache)
    make("writable folders", before=("unshare", "-rm", "sh", "-ec", READ_ONLY, place.folder))
    return rows


def main() -> None:
    """Measure, and write the sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("pythons", nargs="+")
    parser.add_argument("--collect", action="store_true", help="fill the folder of wheels first")
    parser.add_argument("--simulate", action="store_true")
    options = parser.parse_args()
    commit, *_ = run("git", "-C", ROOT, "rev-parse", "--short", "HEAD")
    stamp = {"commit": commit.strip(), "date": date.today().isoformat(), "command": "python scripts/release_matrix.py"}
    for python in options.pythons:
        place = Environment(python, options.work.resolve())
        if options.collect:
            place.collect()
        parts = measure(place)
        found = {"parts": [[f"{seconds:.1f}" for seconds in parts]]}
        if options.simulate and python == options.pythons[-1]:
            found["simulated"] = simulate(place)
        found["installed"] = [[place.version, f"{sum(parts):.0f}", install_extras(place)]]
        print(json.dumps(found, ensure_ascii=False), flush=True)
        tables = (sheet := json.loads(SHEET.read_text(encoding="utf-8")))["tables"]
        others = [row for row in tables["installed"]["rows"] if row[0] != place.version]
        found["installed"] = sorted(others + found["installed"], key=lambda row: row[0])
        for name, rows in found.items():
            tables[name] |= {**stamp, "rows": rows}
        SHEET.write_text(json.dumps(sheet, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
