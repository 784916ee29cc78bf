"""``lipmotion studio`` as a process: its address, requests to it, random edits that a page could make."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from random import Random
from threading import Event, Timer
from typing import Any, NamedTuple

from children import LIMIT_S, LIPMOTION, Child, child
from lipmotion.pipeline.edits import parse_step
from lipmotion_studio.application import TOKEN_HEADER
from study.served import NO_REPLY, Connection

PATIENCE_S = 600.0
PHONES = "p b m f aa iy uw ow s t".split()
WORDS = ("bob", "we may", "so", "put a map")


class Served(NamedTuple):
    process: Child
    port: int
    token: str

    def kill(self) -> None:
        """End it as ``kill -9`` does."""
        self.process.kill()
        self.process.wait()

    def ask(self, path: str, content: Any = None) -> tuple[int, Any]:
        """Return status and content of a reply, over a new connection, as ``Connection.ask``."""
        with closing(Connection(self.port, {TOKEN_HEADER: self.token}, PATIENCE_S)) as connection:
            return connection.ask(path, content)

    def ready(self, number: int = 1) -> dict[str, Any]:
        ends_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < ends_s:
            state = self.ask(f"/api/lines/{number}")[1]
            if state["status"] == "ready":
                return dict(state)
            time.sleep(0.02)
        raise AssertionError(f"line {number} is not ready after {PATIENCE_S} s: {state}")


@contextmanager
def served(source: Path, errors: Path, *options: Path | str, limit_s: float = LIMIT_S) -> Iterator[Served]:
    """Give a studio of a recording or a project; all that it prints on standard error is added to a file."""
    command = [*LIPMOTION, "studio", source, "--no-browser", *options]
    with errors.open("a", encoding="utf-8") as file, child(command, stderr=file, limit_s=limit_s) as process:
        line = process.stdout.readline() if process.stdout else ""
        port, token = line.split("http://127.0.0.1:")[1].split()[0].split("/#")
        yield Served(process, int(port), token)


def edits_of_all_kinds(chance: Random, state: dict[str, Any]) -> list[str]:
    """Return edits that a page could make of a line in this state, of each kind; they may be refused."""
    phones = state["phones"]
    number, word = chance.randrange(1, len(phones) - 1), chance.randrange(max(len(state["words"]), 1)) + 1
    phone, said = phones[number], chance.choice(PHONES)
    start_s = round(chance.uniform(0, phones[-1]["end_s"] - 0.5), 2)
    part = f"from {start_s} to {start_s + chance.uniform(0.05, 0.3):.2f}"
    words = f"say {chance.choice(WORDS)} from {start_s} to {start_s + 0.4:.2f}"
    pinned = f"pin {chance.choice(('opening', 'width'))} {chance.uniform(0, 0.3):.3f} at {start_s}"
    pins = [step.split() for step in state["steps"] if step.startswith("pin ")] or [pinned.split()]
    _, curve, _, _, pinned_s, *_ = chance.choice(pins)
    locked = [step for step in state["steps"] if step.startswith("lock ")] or [f"lock {part}"]
    return [
        f"word {word} is {chance.choice(WORDS).split()[0]}",
        f"word {word} is bob said b {chance.choice(('aa', 'ow'))} b",
        words,
        f"{words} with bob b {chance.choice(('aa', 'ow'))} b",
        f"phone {number + 1} is {said}",
        f"phone {number + 1} begins {phone['start_s'] + chance.uniform(-0.03, 0.03):.3f}",
        f"phone {number + 1} ends {phone['end_s'] + chance.uniform(-0.03, 0.03):.3f}",
        f"split phone {number + 1} at {(phone['start_s'] + phone['end_s']) / 2:.3f}",
        f"remove phone {number + 1}",
        f"insert {said} {part}",
        pinned,
        f"{pinned} slope {chance.uniform(-1, 1):.2f}",
        f"unpin {curve} at {pinned_s}",
        f"pin jawOpen {chance.uniform(0, 1):.3f} at {start_s}",
        f"gain {chance.uniform(0.5, 1.5):.2f} {part}",
        f"gain mouthPucker {chance.uniform(0.5, 1.5):.2f} {part}",
        f"draw {chance.choice(('opening', 'jawOpen'))} 0.05 0.2 0.1 {part}",
        f"hold {part}",
        f"lock {part}",
        f"un{chance.choice(locked)}",
        f"mood {chance.choice(('happy', 'sad:0.5', 'neutral'))} at {start_s}",
        f"set intensity {chance.uniform(0.8, 1.3):.2f}",
        f"set anticipation_ms {chance.randrange(0, 60)}",
        f"set min_hold_ms {chance.choice((0, 0, 60))}",
    ]


def choose_change(chance: Random, state: dict[str, Any]) -> tuple[str, dict[str, Any], list[str]]:
    """Return a change of a line in this state: its address and content, and the edits that there are then."""
    if chance.random() < 0.2 and state["undo"]:
        return "undo", {}, state["steps"][:-1]
    step = chance.choice(edits_of_all_kinds(chance, state))
    return "edits", {"steps": [step]}, [*state["steps"], str(parse_step(step))]  # as it is written


def lost_edits(
    project: Path,
    errors: Path,
    kills: int,
    each_s: float,
    *options: Path | str,
    seed: int = 5,
    report: Callable[[dict[str, int]], object] = lambda _: None,
) -> dict[str, int]:
    """Kill a studio again and again while its line is edited; return what was acknowledged, and what was lost.

    each_s : how long it is edited, at most, between two kills
    report : is called with what was found so far, after each kill
    """
    chance, found = Random(seed), {"kills": 0, "acknowledged": 0, "lost": 0}
    steps: list[str] = []  # that were acknowledged
    sent: list[str] = []  # those of the last request, which may have been answered or not
    while found["kills"] < kills:
        with served(project, errors, *options) as server:
            state, killed = server.ready(), Event()
            found["lost"] += found["kills"] > 0 and state["steps"] not in (steps, sent)
            steps = state["steps"]

            def kill(server: Served = server, killed: Event = killed) -> None:
                killed.set()
                server.process.kill()

            Timer(chance.uniform(0.1, each_s), kill).start()
            with suppress(*NO_REPLY):
                while not killed.is_set():
                    state = server.ask("/api/lines/1")[1]
                    what, content, sent = choose_change(chance, state)
                    status, reply = server.ask(f"/api/lines/1/{what}", {"revision": state["revision"], **content})
                    if status == 200:
                        steps, found["acknowledged"] = reply["steps"], found["acknowledged"] + 1
            server.kill()
        found["kills"] += 1
        report(found)
    return found
