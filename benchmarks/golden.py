"""``python benchmarks/golden.py WORK -o FILE.json [--against FILE.json]``: hashes of trained models and their output.

It uses the command line only, so it runs on any version of the package: every engine is trained on the
tiny corpus, and on twenty clips of GRID where they are present; models are hashed array by array, without the header;
motion, cues, explanations and figures as they are written. Computed floats differ between processors: compare
two versions on one machine.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path

HERE = Path(__file__).parents[1]
GRID = HERE / ".." / "shared" / "corpora" / "grid-s1"
WELCOME, WELCOME_WORDS = HERE / "examples" / "welcome.flac", HERE / "examples" / "welcome.txt"
SYSTEMS = ("ph-HMM", "ph-MSHMM", "ph-FHMM", "ph-vi-FHMM", "ph-CHMM", "ph-vi-CHMM")
ENGINES: dict[str, tuple[str, ...]] = {
    "trajectory": (),
    "trajectory both": ("--visual", "both"),
    "joint": ("--engine", "joint"),
    **{name: ("--engine", "coupled", "--system", name, "--set", "mixtures=2") for name in SYSTEMS},
}
ON_GRID = ("trajectory", "trajectory both", "joint", "ph-MSHMM", "ph-vi-FHMM", "ph-vi-CHMM")
TINY = """
import sys
from pathlib import Path
sys.path.append(sys.argv[2])
from testing.toy import write_toy_recordings
write_toy_recordings(Path(sys.argv[1]))
"""
VERB = "import sys; from lipmotion.cli.main import main; sys.exit(main())"
Hashes = dict[str, str]
TEXTS = ("header.json", "document.npy")
"""What models and motion files say of where they came from: file names, versions."""


def main() -> int:
    """Write the hashes; with ``--against``, name what differs and return 1."""
    parser = argparse.ArgumentParser()
    parser.add_argument("work", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--quick", action="store_true", help="the tiny corpus only, and the shipped model")
    parser.add_argument("--kinds", action="store_true", help="the kinds of files alone, of the shipped model")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    hashes = dict(_kinds(options.work) if options.kinds else _all(options.work, quick=options.quick))
    options.output.write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")
    if options.against is None:
        return 0
    before = json.loads(options.against.read_text(encoding="utf-8"))
    different = [name for name in hashes if hashes[name] != before.get(name)]
    print(f"{len(hashes) - len(different)} of {len(hashes)} equal", *different, sep="\n  ")
    return bool(different)


def _all(work: Path, *, quick: bool) -> Iterator[tuple[str, str]]:
    yield from _outputs("shipped", None, work)
    yield from _kinds(work)
    run(work, "adapt", WELCOME, "-o", work / "adapted.lipmotion")
    yield "shipped: adapted", of_archive(work / "adapted.lipmotion")
    python(TINY, work / "tiny", HERE / "tests")
    yield from _of_corpus("tiny", work / "tiny", ENGINES, work)
    if GRID.is_dir() and not quick:
        yield from _of_corpus("grid", twenty_clips(work / "grid"), ON_GRID, work)


def _of_corpus(name: str, recordings: Path, engines: Iterable[str], work: Path) -> Iterator[tuple[str, str]]:
    corpus = work / f"{name}-corpus"
    run(work, "corpus", "prepare", recordings, "-o", corpus)
    files = sorted(corpus.rglob("*.npy"))
    yield f"{name}: corpus", of_bytes(b"".join(contents(file) for file in files))
    for engine in engines:
        model = work / f"{name}-{engine}.lipmotion"
        model.unlink(missing_ok=True)
        run(work, "train", corpus, "-o", model, *ENGINES[engine])
        yield f"{name}: {engine}: model", of_archive(model)
        yield from _outputs(f"{name}: {engine}", model, work)
        figures = work / "figures.json"
        figures.unlink(missing_ok=True)
        output = run(work, "evaluate", model, corpus, "-o", figures)
        yield f"{name}: {engine}: figures", of_archive(figures) if figures.exists() else output.decode()


def _outputs(name: str, model: Path | None, work: Path) -> Iterator[tuple[str, str]]:
    chosen = ("--model", model) if model else ()
    kinds = ("npz", "json", "csv", "mp4") if model is None else ("npz",)
    for way, arguments in (("audio only", ()), ("transcript", ("--transcript", WELCOME_WORDS))):
        made = [work / f"motion.{kind}" for kind in kinds]
        for file in made:
            file.unlink(missing_ok=True)
        output = run(work, "animate", WELCOME, *chosen, *arguments, "-o", *made)
        for file in made:
            yield f"{name}: {way}: {file.suffix[1:]}", of_archive(file) if file.exists() else output.decode()
        if model is None:
            for kind in ("tsv", "xml", "json", "dat"):
                yield f"{name}: {way}: cues {kind}", of_bytes(run(work, "cues", WELCOME, *arguments, "-f", kind))
    shipped = HERE / "src" / "lipmotion" / "models" / "grid-s1.lipmotion"
    arguments = ("--transcript", WELCOME_WORDS, "--at", "0.5", "--at", "1.0", "--json")
    yield f"{name}: explanation", of_bytes(run(work, "explain", WELCOME, "--model", model or shipped, *arguments))


def _kinds(work: Path) -> Iterator[tuple[str, str]]:
    """Yield hashes of every kind of file, as it is delivered in many ways."""
    said, recording = ("--transcript", WELCOME_WORDS), work / "recordings" / WELCOME.name
    recording.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(WELCOME, recording)  # some files name it by its path from theirs
    kinds = "json csv npz livelink.csv blender.py c3d fap bvh motion3.json glb usda TextGrid vtt".split()
    for way, arguments in DELIVERIES.items():
        made = [work / f"kinds.{kind}" for kind in kinds]
        for file in made:
            file.unlink(missing_ok=True)
        output = run(work, "animate", recording, *said, *arguments, "-o", *made)
        for kind, file in zip(kinds, made, strict=True):
            yield f"kinds: {way}: {kind}", of_archive(file) if file.exists() else output.decode()
    for name, arguments in PICTURES.items():
        for file in work.glob("picture*"):
            file.unlink()
        made = [work / "pictures.mp4", work / "picture%03d.png"]  # .webm has a number by chance
        run(work, "animate", recording, *said, *arguments, "--size", "128", "-o", *made)
        yield f"pictures: {name}", of_bytes(b"".join(map(contents, sorted(work.glob("picture*")))))
    out = work / "batch"
    run(work, "batch", recording.parent, "--out", out, "--to", "json,cues.tsv,cues.xml,TextGrid", "--jobs", "1")
    for file in sorted(out.glob("welcome.*")):
        yield f"batch: {file.name}", of_archive(file)
    run(work, "speak", "--voice", "flite:slt", "hello world", "-o", work / "said.wav", work / "said.json")
    for file in (work / "said.wav", work / "said.json"):
        yield f"speak: {file.suffix}", of_archive(file) if file.exists() else "no voice"


DELIVERIES: dict[str, tuple[str, ...]] = {
    "plain": (),
    "curves": ("--curves", "arkit", "--rate", "30"),
    "face": ("--curves", "face", "--intensity", "1.5", "--anticipation-ms", "40"),
    "stepped": ("--stepped", "--rate", "25", "--face", "head"),
    "moved": ("--offset-ms", "200", "--articulation", "--channels", "opening,tongue"),
    "visemes": ("--curves", "visemes", "--offset-ms", "-120", "--min-hold-ms", "100"),
}
PICTURES: dict[str, tuple[str, ...]] = {
    "portrait": (),
    "head": ("--face", "head", "--background", "#40a0ff", "--fps", "30"),
    "cartoon": ("--face", "cartoon", "--stepped", "--still", "blinks"),
}


def twenty_clips(folder: Path) -> Path:
    """Return a folder of GRID's first 14 clips of train, 3 of val and 3 of test."""
    folder.mkdir(exist_ok=True)
    for split, count in (("train", 14), ("val", 3), ("test", 3)):
        names = (GRID / f"{split}.txt").read_text().split()[:count]
        (folder / f"{split}.txt").write_text("".join(f"{name}\n" for name in names))
        for name in names:
            for file in (*(GRID / "clips").glob(f"{name}.*"), *(GRID / "align").glob(f"{name}.*")):
                link = folder / file.relative_to(GRID)
                link.parent.mkdir(exist_ok=True)
                if not link.exists():
                    link.symlink_to(file.resolve())
    return folder


def python(code: str, *arguments: object) -> bytes:
    """Return what a program writes to standard output; its exit code, where it fails."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(command, check=False, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=os.environ)
    return done.stdout if done.returncode == 0 else f"exit {done.returncode}".encode()


def run(work: Path, *arguments: object) -> bytes:
    """Return what a verb writes to standard output, folders left out."""
    return python(VERB, *arguments).replace(str(work).encode(), b"WORK").replace(str(HERE).encode(), b"HERE")


def of_archive(path: Path) -> str:
    """Return the hash of a file; of a model or of motion that of all arrays by name."""
    return of_bytes(contents(path))


def contents(path: Path) -> bytes:
    """Return the bytes of a file, of a zip those of its arrays by name."""
    if not zipfile.is_zipfile(path):
        return path.name.encode() + path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        names = sorted(name for name in archive.namelist() if name not in TEXTS)
        return b"".join(name.encode() + archive.read(name) for name in names)


def of_bytes(found: bytes) -> str:
    """Return the first half of the SHA-256."""
    return sha256(found).hexdigest()[:32]


if __name__ == "__main__":
    sys.exit(main())
