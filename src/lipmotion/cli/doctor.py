"""What is installed, what missing parts would bring, and whether the main path works on this machine."""

from __future__ import annotations

import math
import os
import platform
import tempfile
from collections.abc import Callable, Iterator
from ctypes.util import find_library
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from packaging.requirements import Requirement

from lipmotion.errors import LipMotionError, MissingDependencyError, ModelFormatError
from lipmotion.extensions import find_version, install_command, load_provided
from lipmotion.pipeline.job import Job
from lipmotion.pipeline.request import Outputs, Request
from lipmotion.storage.sources import hash_file, read_shipped_table
from lipmotion.types.delivery import Staging

if TYPE_CHECKING:
    from lipmotion.types import Audio

State = Literal["works", "absent", "broken"]
EXTRAS = {row["extra"]: row["brings"] for row in read_shipped_table("lipmotion.cli", "extras.csv")}
"""What each extra of the package brings."""
WORDS = "mama"
LOUDNESS = ((0.3, 0.0), (0.09, 0.25), (0.16, 1.0), (0.09, 0.25), (0.1, 1.0), (0.3, 0.0))
"""Durations in seconds, and levels, of a made-up second of speech: silence, m, a, m, a, silence."""
CLOSED, OPEN = ((260, 70),), ((730, 70), (1090, 100), (2440, 160))
"""Resonances of the mouth in m and in a: their frequencies and widths, Hz (Klatt 1980)."""
MIN_OPENING = 0.03  # opening of the lips that *mama* has at least, in distances between the outer eye corners
OPENCV = "opencv-python-headless"


@dataclass(frozen=True)
class InstalledPart:
    """A part of the installation that was looked at.

    name  : what it is
    state : ``works``, ``absent`` (a part that nothing else needs) or ``broken``
    text  : what was found; of what is absent or broken, what it would bring and what to do
    """

    name: str
    state: State
    text: str


def doctor() -> Iterator[InstalledPart]:
    """Yield what is found out about this installation, the main path last. Nothing is left on the disk."""
    system = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    yield InstalledPart("lipmotion", "works", f"{find_version()}, Python {system}")
    declared = list_requirements()
    if not declared:
        yield InstalledPart("packages", "absent", "not known: lipmotion runs from its sources; pip install .")
    needed = sorted((each for each in declared if "extra ==" not in str(each.marker)), key=_applies)
    for each in {each.name: each for each in needed}.values():  # of several by one name, that for this Python
        installed = _find_installed(each.name)
        if not _applies(each):
            yield InstalledPart(each.name, "absent", f"none for this Python or system (required: {each.marker})")
        elif _is_met(each):
            yield InstalledPart(each.name, "works", installed)
        else:
            command = f"pip install '{each.name}{each.specifier}'"
            text = f"{installed or 'not installed'}, required {each.specifier}: {command}"
            yield InstalledPart(each.name, "broken", text)
    for extra, brings in EXTRAS.items():
        packages = [each for each in declared if f'extra == "{extra}"' in str(each.marker)]
        unmet = [each for each in packages if not _is_met(each)]
        other = next((each for each in unmet if not _applies(each, extra)), None)
        text = ", ".join(f"{each.name} {_find_installed(each.name)}" for each in packages)
        if other is not None:
            text = f"{brings}; not for this Python or system (required: {other.marker})"
        elif unmet:
            lacks = (f"{_find_installed(each.name) or 'no'} {each.name} (required {each.specifier})" for each in unmet)
            text = f"{brings}: {install_command(extra)}; there is {', '.join(lacks)}"
        if packages:
            yield InstalledPart(f"[{extra}]", "absent" if unmet else "works", text)
    yield from map(look_at, _PARTS)


def list_requirements() -> tuple[Requirement, ...]:
    """Return all requirements of the installed lipmotion; none where it runs from its sources, without metadata."""
    try:
        return tuple(map(Requirement, metadata.requires("lipmotion") or ()))
    except metadata.PackageNotFoundError:
        return ()


def _applies(requirement: Requirement, extra: str = "") -> bool:
    """Return whether this Python and this system have a requirement, of an extra or of the package itself."""
    return requirement.marker is None or requirement.marker.evaluate({"extra": extra})


def _find_installed(name: str) -> str:
    """Return the installed version of a package; empty: it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _is_met(requirement: Requirement) -> bool:
    installed = _find_installed(requirement.name)
    return bool(installed) and requirement.specifier.contains(installed, prereleases=True)


def look_at(name: str) -> InstalledPart:
    """Return what a look at one of the parts that are no packages says; whatever it raises, the part is broken."""
    try:
        return InstalledPart(name, "works", _PARTS[name]())
    except _AbsentError as absent:
        return InstalledPart(name, "absent", str(absent))
    except LipMotionError as error:
        return InstalledPart(name, "broken", str(error))
    except Exception as error:  # a damaged package may raise anything when it is imported
        return InstalledPart(name, "broken", f"{type(error).__name__}: {error}; install lipmotion again")


class _AbsentError(Exception):
    """Says what an absent part would bring."""


def _ffmpeg() -> str:
    import av
    from av.codec import codecs_available

    missing = [codec for codec in ("libx264", "aac") if codec not in codecs_available]
    if missing:
        raise LipMotionError(f"no {' and no '.join(missing)}, so no .mp4; install PyAV as a wheel: pip install -U av")
    return f"{getattr(av, 'ffmpeg_version_info', '')} in PyAV {metadata.version('av')}, with H.264 and AAC".strip()


def _voices() -> str:
    from lipmotion.speech.voices.installed import SYNTHESISERS, explain_install, explain_missing_synthesiser

    found, others = [], []
    for each in SYNTHESISERS.values():
        try:
            if count := len(each.voices()) + len(each.others()):
                found.append(f"{each.name} {count}")
            else:
                others.append(f"no {each.name} ({explain_install(each)})")
        except LipMotionError as error:
            others.append(f"{each.name} does not work ({error})")
    if not found:
        raise _AbsentError(f"{EXTRAS['text']}; {explain_missing_synthesiser()}")
    return "; ".join([*found, *others])


def _phone_recogniser() -> str:
    from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser, load_phone_recogniser

    if find_installed_recogniser() is None:
        raise _AbsentError("none for this machine: voices that the model does not know are recognised less well")
    return load_phone_recogniser().source


def _microphone() -> str:
    """Return the version of sounddevice; it is not imported: that starts PortAudio, which may end the process."""
    if not find_spec("sounddevice") or not (find_spec("_sounddevice_data") or find_library("portaudio")):
        raise _AbsentError(f"for 'live': {install_command('live')}, on Linux also libportaudio2")
    return f"sounddevice {metadata.version('sounddevice')}, PortAudio"


def _face_tracking() -> str:
    """Return which OpenCV and MediaPipe are imported, and whether another OpenCV lies over that of the extra."""
    try:
        opencv = load_provided("tracking_versions")()
    except MissingDependencyError as error:
        raise _AbsentError(str(error)) from error
    found = f"OpenCV {opencv}, MediaPipe {metadata.version('mediapipe')}"
    declared = _find_installed(OPENCV)
    over = f"{OPENCV} is {declared or 'not installed'}: another OpenCV lies over it, as pip installs with MediaPipe"
    return found if declared.startswith(opencv) else f"{found}; {over}; see requirements/video.txt (docs/start.md)"


def _model() -> str:
    from lipmotion.pipeline.model import find_shipped, load_model, read_header

    path = find_shipped()
    try:
        header, engine = read_header(path), load_model(path).engine.name
    except LipMotionError as error:
        raise ModelFormatError(f"{error}; or install lipmotion again: pip install --force-reinstall") from error
    digest, size = hash_file(path)[:12], path.stat().st_size / 1e6
    return f"{path.name}, {engine}, version {header['version']}, {size:.1f} MB, sha256 {digest}"


def _compiled_kernels() -> str:
    from lipmotion.kernels.compiler import cache_folder, numba_works

    if not numba_works():
        raise _AbsentError("no numba here: everything works, training and drawing take far longer")
    folder = cache_folder()
    if folder is None:
        raise _AbsentError("nowhere to keep machine code: every long command compiles again; set NUMBA_CACHE_DIR")
    return f"kept in {folder}"


def _temporary_folder() -> str:
    try:
        with tempfile.TemporaryFile(buffering=0) as file:
            file.write(b"lipmotion")
    except OSError as error:
        raise LipMotionError(f"{error}; set TMPDIR to a folder that can be written") from error
    return tempfile.gettempdir()


def _current_folder() -> str:
    folder = Path.cwd()
    if not os.access(folder, os.W_OK):
        raise _AbsentError(f"{folder} cannot be written: give outputs in another folder, as -o /tmp/a.mp4")
    return str(folder)


def _say_mama() -> Audio:
    """Return a second of made-up speech: the pulses of a voice, through the mouth as it opens and closes."""
    import numpy as np
    from scipy.signal import lfilter

    from lipmotion.types import Audio

    rate_hz, parts = 16_000, []
    level = np.repeat([level for _, level in LOUDNESS], [round(length_s * rate_hz) for length_s, _ in LOUDNESS])
    level = np.convolve(level, np.hanning(320) / np.hanning(320).sum(), "same")
    opened, pulses = np.clip((level - 0.25) / 0.75, 0, 1), np.arange(len(level)) * 120 / rate_hz % 1 < 0.02
    for resonances, share in ((CLOSED, level - opened * 0.75), (OPEN, opened)):
        sound = pulses - 0.02
        for centre_hz, width_hz in resonances:
            radius = np.exp(-np.pi * width_hz / rate_hz)
            poles = [1, -2 * radius * np.cos(2 * np.pi * centre_hz / rate_hz), radius**2]
            sound = lfilter([sum(poles)], poles, sound)
        parts.append(share * sound / np.abs(sound).max())
    noise = np.random.default_rng(0).normal(0, 3e-4, len(level))
    return Audio((0.3 * sum(parts) + noise).astype(np.float32), rate_hz)


def _main_path() -> str:
    """Animate the made-up speech, and write motion, cues and video; return what came out."""
    from lipmotion.formats.sound import write_sound
    from lipmotion.storage.locks import open_temporary

    with open_temporary() as folder:
        sound = folder / "mama.wav"
        write_sound(sound, _say_mama())
        files = tuple(str(folder / name) for name in ("mama.json", "mama.cues.tsv", "mama.mp4"))
        job = Job(Request(sound, transcript=WORDS), Outputs(files), staging=Staging(size=128))
        motion = job.run().motion
        sizes = [Path(file).stat().st_size for file in files]
    widest = float(motion["opening"].max())
    if not (math.isfinite(widest) and widest > MIN_OPENING and min(sizes) > 0):
        raise LipMotionError(f"the lips open by {widest:.3f}, required more than {MIN_OPENING}; install numpy again")
    written = ", ".join(Path(file).name.partition(".")[2] for file in files)
    return f"{motion.time_s[-1]:.1f} s of made-up speech → {written}; the lips open by {widest:.2f}"


_PARTS: dict[str, Callable[[], str]] = {
    "FFmpeg": _ffmpeg,
    "voices": _voices,
    "phone recogniser": _phone_recogniser,
    "microphone": _microphone,
    "face tracking": _face_tracking,
    "model that ships": _model,
    "compiled kernels": _compiled_kernels,
    "temporary folder": _temporary_folder,
    "current folder": _current_folder,
    "main path": _main_path,
}
