"""A study that a process of its own serves, and raters written as programs, who speak HTTP to it."""

import http.client
import json
import socket
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from children import LIPMOTION, Child, child
from lipmotion_studio.study.manifest import Study
from study.hostile import Hostile
from study.small_study import scripted_answer

NO_REPLY = (ConnectionError, http.client.HTTPException, TimeoutError)
PATIENCE_S = 60.0


@dataclass(frozen=True)
class Server:
    """A server: its process, and its port."""

    process: Child
    port: int

    def kill(self) -> None:
        """End it as ``kill -9`` does."""
        self.process.kill()
        self.process.wait()


@contextmanager
def served(folder: Path, errors: Path, port: int = 0) -> Iterator[Server]:
    """Give a server of a study, whose standard error is added to a file; ``port`` 0: any that is free."""
    command = [*LIPMOTION, "study", "serve", folder, "--port", port]
    with errors.open("a", encoding="utf-8") as file, child(command, stderr=file) as process:
        line = process.stdout.readline() if process.stdout else ""
        yield Server(process, int(line.split("http://127.0.0.1:")[1].split("/")[0]))


class Connection:
    """Requests to a server, one after another, over one connection as long as it lasts; ``headers`` of all of them."""

    def __init__(self, port: int, headers: dict[str, str], patience_s: float = 30) -> None:
        self.headers = {"content-type": "application/json", **headers}
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=patience_s)

    def ask(self, path: str, content: Any = None) -> tuple[int, Any]:
        """Return status and content of a reply: of JSON, the object. Raises an error of ``NO_REPLY``: none came."""
        body = None if content is None else json.dumps(content)
        try:
            self._connection.request("GET" if body is None else "POST", path, body, self.headers)
            reply = self._connection.getresponse()
            found = reply.read()
            return reply.status, json.loads(found) if reply.getheader("content-type") == "application/json" else found
        except BaseException:
            self.close()
            raise

    def ask_until_answered(self, path: str, content: Any = None) -> Any:
        """Return the content of a reply, as the page does: again after no reply, and after one that says so."""
        ends_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < ends_s:
            with suppress(*NO_REPLY):
                status, reply = self.ask(path, content)
                if status < 300:
                    return reply
                if status != 429 and status < 500:
                    raise AssertionError(f"{path}: {status} {reply}")
            time.sleep(0.05)
        raise AssertionError(f"{path}: no answer within {PATIENCE_S} s")

    def close(self) -> None:
        self._connection.close()


def attacked(
    port: int, requests: Iterable[Hostile], secrets: Iterable[bytes]
) -> Iterator[tuple[http.client.HTTPResponse, bytes]]:
    """Send hostile requests, and what is no request; give the replies and their bodies.

    Raises AssertionError: a reply holds what nobody may read.
    """
    for hostile in requests:
        raw = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
        with closing(raw), suppress(*NO_REPLY, ValueError):  # closed, which is safe; or nothing that can be sent
            raw.putrequest(hostile.method, hostile.path, skip_host="host" in hostile.headers, skip_accept_encoding=True)
            for name, value in {**hostile.headers, "content-length": str(len(hostile.body))}.items():
                raw.putheader(name, value.encode("utf-8"))
            raw.endheaders(hostile.body)
            reply = raw.getresponse()
            body = reply.read()
            assert [secret for secret in (b"root:", *secrets) if secret in body] == [], hostile
            yield reply, body
    for content in (b"\x16\x03\x01" * 200, b"GET / HTTP/9.9\r\n\r\n", b"GET /" + b"a" * 100_000, b"\r\n" * 500):
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as plain:
            plain.sendall(content)


class ScriptedRater(threading.Thread):
    """A rater that is a program: answers as fast as it can, and keeps what was acknowledged.

    acknowledged : value of the answer to each trial, by its number, for which the server said that it is stored
    pause_s      : before each answer
    """

    def __init__(self, study: Study, port: int, number: int, pause_s: float = 0.0) -> None:
        super().__init__(name=f"scripted rater {number}", daemon=True)
        self.acknowledged: dict[int, str] = {}
        self.failure: BaseException | None = None
        self._study, self._port, self._number, self._pause_s = study, port, number, pause_s

    def run(self) -> None:
        """Take part from the first trial to the last."""
        connection = Connection(self._port, {})
        try:
            now = connection.ask_until_answered("/api/raters", {"agrees": True})
            connection.headers["authorization"] = f"Bearer {now['token']}"
            while now["trial"] < now["trials"]:
                time.sleep(self._pause_s)
                value = ("first", "second")[(self._number + now["trial"]) % 2]
                now = connection.ask_until_answered("/api/answers", scripted_answer(self._study, now, value))
                self.acknowledged[now["stored"]] = value
        except BaseException as failure:
            self.failure = failure
        finally:
            connection.close()
