"""``lipmotion studio`` as a process: its address, requests to it, random edits that a page could make."""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from threading import Event, Thread
from typing import Any, NamedTuple

from children import LIPMOTION, Child, child
from lipmotion.studio.access import TOKEN_HEADER
from study.served import NO_REPLY

PATIENCE_S = 120.0
PHONES = "p b m f aa iy uw ow s t".split()


class Served(NamedTuple):
    """A studio that is served: its process, its port and its token."""

    process: Child
    port: int
    token: str

    def kill(self) -> None:
        """End it as ``kill -9`` does."""
        self.process.kill()
        self.process.wait()

    def ask(self, path: str, content: Any = None, **headers: str) -> tuple[int, Any]:
        """Return status and content of a reply: of JSON, the object. Raises an error of ``NO_REPLY``: none came."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        try:
            body = None if content is None else json.dumps(content)
            sent = {TOKEN_HEADER: self.token, "content-type": "application/json"} | headers
            connection.request("GET" if body is None else "POST", path, body, sent)
            reply = connection.getresponse()
            found = reply.read()
            return reply.status, json.loads(found) if reply.getheader("content-type") == "application/json" else found
        finally:
            connection.close()

    def ready(self, number: int = 1) -> dict[str, Any]:
        """Return the state of a line once it is understood."""
        ends_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < ends_s:
            state = self.ask(f"/api/lines/{number}")[1]
            if state["status"] == "ready":
                return dict(state)
            time.sleep(0.02)
        raise AssertionError(f"line {number} is not ready after {PATIENCE_S} s: {state}")


@contextmanager
def served(source: Path, errors: Path, model: Path | None = None) -> Iterator[Served]:
    """Give a studio of a recording or a project; all that it prints on standard error is added to a file."""
    command = [*LIPMOTION, "studio", source, "--no-browser", *(["--model", model] if model else [])]
    with errors.open("a", encoding="utf-8") as file, child(command, stderr=file) as process:
        line = process.stdout.readline() if process.stdout else ""
        port, token = line.split("http://127.0.0.1:")[1].split()[0].split("/#")
        yield Served(process, int(port), token)


def random_edit(chance: Random, phones: Sequence[dict[str, Any]]) -> str:
    """Return an edit that a page could make of a line with these phones; it may be refused."""
    number = chance.randrange(1, len(phones) - 1)
    phone, last_s = phones[number], phones[-1]["end_s"]
    time_s = round(chance.uniform(0, last_s - 0.3), 2)
    return chance.choice(
        [
            f"phone {number + 1} is {chance.choice(PHONES)}",
            f"phone {number + 1} ends {phone['end_s'] + chance.uniform(-0.03, 0.03):.3f}",
            f"split phone {number + 1} at {(phone['start_s'] + phone['end_s']) / 2:.3f}",
            f"remove phone {number + 1}",
            f"pin opening {chance.uniform(0, 0.3):.3f} at {time_s}",
            f"pin jawOpen {chance.uniform(0, 1):.3f} at {time_s}",
            f"gain {chance.uniform(0.5, 1.5):.2f} from {time_s} to {time_s + 0.2:.2f}",
            f"draw opening 0.05 0.2 0.1 from {time_s} to {time_s + 0.1:.2f}",
            f"hold from {time_s} to {time_s + 0.05:.2f}",
            f"mood {chance.choice(('happy', 'sad:0.5', 'neutral'))} at {time_s}",
            f"set intensity {chance.uniform(0.8, 1.3):.2f}",
        ]
    )


class Editor:
    """Makes random edits through a server, one after another, and keeps which were acknowledged."""

    def __init__(self, seed: int) -> None:
        self._chance = Random(seed)
        self.steps: list[str] = []
        self.sent: list[str] = []
        """The edits of the last request that was sent, all of them; it may have been answered or not."""

    def edit(self, server: Served) -> int:
        """Make one edit, or take one back; return the status of the reply. Raises an error of ``NO_REPLY``."""
        state = server.ask("/api/lines/1")[1]
        if self._chance.random() < 0.2 and state["undo"]:
            self.sent = state["steps"][:-1]
            status, reply = server.ask("/api/lines/1/undo", {"revision": state["revision"]})
        else:
            step = random_edit(self._chance, state["phones"])
            self.sent = [*state["steps"], step]
            status, reply = server.ask("/api/lines/1/edits", {"revision": state["revision"], "steps": [step]})
        if status == 200:
            self.steps = reply["steps"]
        return status


def lost_edits(
    project: Path,
    model: Path | None,
    errors: Path,
    kills: int,
    each_s: float,
    seed: int = 5,
    report: Callable[[dict[str, int]], object] = lambda _: None,
) -> dict[str, int]:
    """Kill a studio again and again while its line is edited; return what was acknowledged, and what was lost.

    each_s : how long it is edited, at most, between two kills
    report : is called with what was found so far, after each kill
    """
    editor, chance = Editor(seed), Random(seed)
    found = {"kills": 0, "acknowledged": 0, "lost": 0}
    while found["kills"] < kills:
        with served(project, errors, model) as server:
            state = server.ready()
            if found["kills"] and state["steps"] not in (editor.steps, editor.sent):
                found["lost"] += 1
            ends_s = time.monotonic() + chance.uniform(0.1, each_s)
            editor.steps = state["steps"]
            killed = _killed_at(server, ends_s)
            with suppress(*NO_REPLY):
                while not killed.is_set():
                    found["acknowledged"] += editor.edit(server) == 200
            server.kill()
        found["kills"] += 1
        report(found)
    return found


def _killed_at(server: Served, ends_s: float) -> Event:
    """Kill a server at a time, whatever it does then; return the event that says that it has happened."""
    killed = Event()

    def kill() -> None:
        time.sleep(max(ends_s - time.monotonic(), 0))
        killed.set()
        server.process.kill()

    Thread(target=kill, daemon=True).start()
    return killed
