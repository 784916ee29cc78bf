"""The studio measured: how long an edit takes, kills, hostile requests, two clients, a crowd.

python benchmarks/studio.py times RECORDING [SECONDS ...]     processor time from an edit to the weights of the head
python benchmarks/studio.py browser RECORDING [SECONDS ...] [--count 20]  from a key to the moved face in Chromium
python benchmarks/studio.py kills RECORDING [--count 100]     of the server while its line is edited
python benchmarks/studio.py hostile RECORDING [--count 2000]
python benchmarks/studio.py clients RECORDING [--count 2000]  steps of two clients; sounds are those of the toy corpus
python benchmarks/studio.py crowd RECORDING [--count 1000]    edits beside so many connections without a request

Recordings are repeated, or cut, to the seconds. Times are of the processor, in one process, without the network and the
browser: a minute of the clock on a machine that does other work says nothing. ``browser`` gives both.
"""

from __future__ import annotations

import argparse
import json
import resource
import selectors
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from random import Random
from typing import Any, NoReturn

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "src")]


from lipmotion.formats.sound import write_sound  # noqa: E402
from lipmotion.kernels.compiler import numba_works  # noqa: E402
from lipmotion.pipeline.edit_files import EditFile  # noqa: E402
from lipmotion.pipeline.model import load_model  # noqa: E402
from lipmotion.pipeline.request import Request  # noqa: E402
from lipmotion.speech.sound.audio_files import read_audio  # noqa: E402
from lipmotion.storage.json_text import as_json  # noqa: E402
from lipmotion.types import Audio, Timeline  # noqa: E402
from lipmotion_faces.characters.character_files import load_character  # noqa: E402
from lipmotion_faces.mesh import MeshFace  # noqa: E402
from lipmotion_faces.outputs.shown_faces import ShownFace, shown_face  # noqa: E402
from lipmotion_faces.registry import make_face  # noqa: E402
from lipmotion_studio.folder import open_folder  # noqa: E402
from lipmotion_studio.recording import OpenRecording, analyse_recording, open_recording  # noqa: E402
from meshes.heads import head, write_glb  # noqa: E402
from studio.hostile import attack  # noqa: E402
from studio.served import Served, lost_edits, served  # noqa: E402
from studio.two_clients import walk  # noqa: E402
from testing.toy import toy_sentences  # noqa: E402

RECOGNISED_S = 100.0  # in longer recordings phones are repeated, not recognised
STEPS_OF_A_WALK = 80
EDITS, FEW_EDITS = 40, 10
"""Edits of which the time is taken, after some that load what they need; of longer recordings fewer."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=WHAT)
    parser.add_argument("recording", type=Path)
    parser.add_argument("seconds", type=float, nargs="*")
    parser.add_argument("--count", type=int, default=0)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        sound = Path(shutil.copy(options.recording, name))
        print(json.dumps(WHAT[options.what](sound, options), indent=1))


def opened(sound: Path) -> OpenRecording:
    """Return a line of a new project, open."""
    model = load_model()
    with open_folder(sound) as folder:
        line = folder.find_recording(1)
        return open_recording(folder, line, model, analyse_recording(folder, line, model))


def times(sound: Path, options: argparse.Namespace) -> dict[str, Any]:
    return {f"{seconds:g} s": times_of(sound, seconds) for seconds in options.seconds or (10.0,)}


def times_of(sound: Path, seconds: float) -> dict[str, Any]:
    """Return milliseconds of the processor from an edit to what the page shows of it, and to a first picture."""
    part, each_s = lasting(sound, seconds)
    numba_works()
    found: dict[str, Any] = {}
    if seconds <= RECOGNISED_S:
        started_s = time.process_time()
        line = opened(part)
        found["until it is open, s"] = round(time.process_time() - started_s, 2)
    else:
        line = repeated(sound, part, each_s, seconds)
    drawn = shown_face("head")
    for phone in "mpmp":  # loads what edits and faces need
        timed_edit(line, f"phone 3 is {phone}")
        line.compute_weights(drawn, slice(0, 20))
    if seconds <= RECOGNISED_S:
        found |= {"the head, all of it, s": round(timed(lambda: line.compute_weights(drawn)) / 1000, 2)}
    own = own_character(sound.with_name("own.glb"))
    found["a character of one's own, 45 frames of it, s"] = round(
        timed(lambda: line.compute_weights(own, slice(200, 245))) / 1000, 2
    )
    found |= {"a picture of the woman, s": round(timed(lambda: line.draw(1.0, make_face("woman"))) / 1000, 2)}
    chance, parts = Random(3), []  # noqa: S311
    while len(parts) < (EDITS if seconds <= RECOGNISED_S else FEW_EDITS):
        phones = line.describe()["phones"]
        number = chance.randrange(2, len(phones) - 1)
        changed, edit_ms = timed_edit(line, phone_edit(chance, phones, number))
        if changed:
            state_ms = timed(lambda: as_json(line.describe()))
            frames = slice(round(changed["start_s"] * 100), round(changed["end_s"] * 100) + 1)
            weights_ms = timed(lambda frames=frames: line.compute_weights(drawn, frames))
            parts.append(
                (edit_ms, state_ms, weights_ms, edit_ms + state_ms + weights_ms, 10 * (frames.stop - frames.start))
            )
    names = ("motion, and the file of edits", "state", "weights of the head where it moved", "together", "moved, ms")
    for name, column in zip(names, zip(*parts, strict=True), strict=True):
        found[name] = [round(float(np.percentile(column, share)), 1) for share in (50, 95)]
    return found | {"memory, MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024}


def own_character(path: Path) -> ShownFace:
    """Return a head with 16 blendshapes, as a character of a user's own."""
    write_glb(path, head())
    return shown_face(MeshFace(load_character(path)))


def lasting(sound: Path, seconds: float) -> tuple[Path, float]:
    """Return a recording that is repeated, or cut, to some seconds, and how long it was."""
    whole = read_audio(sound)
    samples = np.tile(whole.samples, int(np.ceil(seconds / whole.duration_s)))[: round(seconds * whole.rate_hz)]
    part = sound.with_name(f"part-{seconds:g}.wav")
    write_sound(part, Audio(samples, whole.rate_hz))
    return part, whole.duration_s


def in_browser(sound: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Measure the page in Chromium."""
    from studio_browser import measured_page, settled_load

    found: dict[str, Any] = {}
    for seconds in options.seconds or (10.0,):
        part, each_s = lasting(sound, seconds)
        if seconds > RECOGNISED_S:
            repeated(sound, part, each_s, seconds)
        with served(part, sound.with_name("errors.txt")) as server:
            server.ready()
            name, load = f"{seconds:g} s", settled_load()
            page = measured_page(server, sound.with_name(f"home-{seconds:g}"), options.count or 20)
            found[name] = {"before": load} | page | {"after": settled_load()}
            told({name: found[name]})
    return found


def repeated(sound: Path, part: Path, each_s: float, seconds: float) -> OpenRecording:
    """Return the line of a recording that is repeated, open, with the phones of the recording again and again."""
    units = opened(sound).file.units
    assert units is not None
    spans = [span for n in range(int(seconds / each_s)) for span in units.shifted(n * each_s)]
    spans[-1] = replace(spans[-1], end_s=seconds)
    with open_folder(part) as folder:
        line, model = folder.find_recording(1), load_model()
        folder.write_edits(line, EditFile(named=Request(part), units=Timeline(tuple(spans)), sha256=line.sha256))
        return open_recording(folder, line, model)


def phone_edit(chance: Random, phones: list[dict[str, Any]], number: int) -> str:
    """Return an edit that changes a phone, or moves its end by 10 ms."""
    if chance.random() < 0.5:
        return f"phone {number + 1} is {chance.choice('p m f aa iy uw'.split())}"
    end_s, middle_s = phones[number]["end_s"], (phones[number]["start_s"] + phones[number]["end_s"]) / 2
    return f"phone {number + 1} ends {max(end_s - 0.01, middle_s):.3f}"


def timed(do: Callable[[], object]) -> float:
    """Return milliseconds of the processor that something takes."""
    started_s = time.process_time()
    do()
    return 1000 * (time.process_time() - started_s)


def timed_edit(line: OpenRecording, step: str) -> tuple[dict[str, float] | None, float]:
    """Return what an edit moved, None: nothing, or it was refused; and the milliseconds that it took."""
    started_s = time.process_time()
    try:
        changed = line.edit(line.revision, (step,))["changed"]
    except ValueError:
        changed = None
    return changed, 1000 * (time.process_time() - started_s)


def kills(sound: Path, options: argparse.Namespace) -> dict[str, Any]:
    errors = sound.with_name("errors.txt")
    found = lost_edits(sound, errors, options.count or 100, 2.0, seed=options.seed, report=told)
    return found | {"tracebacks": errors.read_text(encoding="utf-8").count("Traceback")}


def told(found: dict[str, Any]) -> None:
    """Print what was found so far: kills of a server, and browsers, take minutes."""
    print(json.dumps(found), file=sys.stderr, flush=True)


def hostile(sound: Path, options: argparse.Namespace) -> dict[str, Any]:
    errors, count = sound.with_name("errors.txt"), options.count or 2000
    with served(sound, errors) as server:
        server.ready()
        statuses = attack(server, sound.parent, count)
        server.ready()
        server.kill()
    tracebacks = errors.read_text(encoding="utf-8").count("Traceback")
    return {"requests": count, "statuses": sorted(statuses), "foreign files": 0, "tracebacks": tracebacks}


def clients(sound: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Let two clients change a project that is changed behind their backs; an AssertionError: something was lost."""
    started_s, count = time.monotonic(), options.count or 2000
    walked = walk(load_model(), toy_sentences(3)[0], sound.parent, -(-count // (STEPS_OF_A_WALK - 5)), STEPS_OF_A_WALK)
    found = {"steps": walked.steps, "acknowledged": walked.acknowledged, "late, and told so": walked.late}
    found |= {"refused": walked.refused, "lost": 0, "mixed up": 0, "tracebacks": 0}
    return found | {"minutes": round((time.monotonic() - started_s) / 60, 1)}


def crowd(sound: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return milliseconds of the clock of an edit over HTTP: alone, and beside connections that let the server wait.

    A process of its own holds them, and opens each again that is closed. Edits are made over new connections.
    """
    errors, count, found = sound.with_name("errors.txt"), options.count or 1000, {}
    with served(sound, errors) as server:
        server.ready()
        edits_over_http(server)
        for name, sent in {"alone": None, **WAITING}.items():
            holder = get_context("spawn").Process(target=hold, args=(server.port, count, sent or b""), daemon=True)
            if sent is not None:
                holder.start()
                time.sleep(3)
            found[name] = edits_over_http(server)
            told({name: found[name]})
            if sent is not None:
                holder.kill()
                holder.join()
    found["slowest, times alone"] = round(max(each[0] for each in found.values()) / found["alone"][0], 2)
    return found | {"tracebacks": errors.read_text(encoding="utf-8").count("Traceback")}


WAITING = {
    "without a request": b"",
    "with half a header": b"GET / HTTP/1.1\r\nhost: 127",
    "with a body that does not come": b"POST /api/lines/1/edits HTTP/1.1\r\nhost: a\r\ncontent-length: 99\r\n\r\n",
}


def edits_over_http(server: Served) -> list[float]:
    """Return median and 95 % of the times of edits [ms]; each must be acknowledged."""
    times_ms = []
    for number in range(EDITS):
        body = {"revision": server.ready()["revision"], "steps": [f"phone 3 is {'pm'[number % 2]}"]}
        started_s = time.perf_counter()
        status, _ = server.ask("/api/lines/1/edits", body)
        times_ms.append(1000 * (time.perf_counter() - started_s))
        assert status == 200, status
    return [round(float(np.percentile(times_ms, share)), 1) for share in (50, 95)]


def hold(port: int, count: int, sent: bytes) -> NoReturn:
    """Hold so many connections, on which so much is sent; open each again that the server closes."""
    selector = selectors.DefaultSelector()
    while True:
        while len(selector.get_map()) < count:
            with suppress(OSError):
                client = socket.create_connection(("127.0.0.1", port))
                client.sendall(sent)
                client.setblocking(False)
                selector.register(client, selectors.EVENT_READ)
        for key, _ in selector.select():
            try:
                is_open = bool(key.fileobj.recv(1 << 16))
            except OSError:
                is_open = False
            if not is_open:
                selector.unregister(key.fileobj)
                key.fileobj.close()
        time.sleep(0.05)  # so that the machine is not busy with the crowd alone


WHAT = {"crowd": crowd, "times": times, "browser": in_browser, "kills": kills, "hostile": hostile, "clients": clients}

if __name__ == "__main__":
    main()
