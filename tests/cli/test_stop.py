from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from argparse import Namespace
from pathlib import Path

import pytest

from cli.conftest import Run
from lipmotion.cli import info
from lipmotion.cli.stop import Stopper

LINE = "lipmotion: stopped; run the same command again to go on"
BOTH = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")


@BOTH
def test_a_signal_is_one_line_and_an_exit_code(
    run: Run, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM), sys.excepthook

    def kill(_: Namespace) -> None:
        signal.raise_signal(number)
        raise AssertionError

    monkeypatch.setattr(info, "run", kill)
    assert run("info") == (128 + number, [], [LINE])
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM), sys.excepthook) == before


@pytest.mark.parametrize("error", [ImportError("cannot import"), OSError("interrupted"), ZeroDivisionError()])
def test_an_error_that_follows_from_a_signal_is_not_shown(
    run: Run, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def kill(_: Namespace) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise error from None

    monkeypatch.setattr(info, "run", kill)
    assert run("info") == (130, [], [LINE])


def test_a_second_signal_at_once_does_not_disturb_the_tidying_up(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    tidied = []

    def kill(_: Namespace) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGINT)
            tidied.append(True)

    monkeypatch.setattr(info, "run", kill)
    assert run("info").code == 130
    assert tidied == [True]


def test_an_ignored_signal_stays_ignored(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        monkeypatch.setattr(info, "run", lambda _: signal.raise_signal(signal.SIGINT))
        assert run("info") == (0, [], [])
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_without_a_signal_nothing_is_raised() -> None:
    Stopper().check()


@BOTH
def test_while_packages_are_imported(number: signal.Signals, toy_speech: Path, here: Path) -> None:
    """The signal comes when the program has said nothing yet: it is sent by the first package that is imported."""
    (here / "numpy.py").write_text(f"import os\nos.kill(os.getpid(), {int(number)})\nwhile True: pass\n")
    done = subprocess.run(
        [sys.executable, "-m", "lipmotion.cli.main", "animate", str(toy_speech), "-o", "a.json"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(here), *sys.path])},
    )
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", LINE + "\n")
    assert [path.name for path in here.iterdir() if path.name != "__pycache__"] == ["numpy.py"]


@BOTH
def test_training_stopped_in_the_middle_goes_on(
    number: signal.Signals, toy_corpus, here: Path, run_outside: Run
) -> None:
    run_outside("train", toy_corpus.path, "-o", "whole.lipmotion")
    command = [sys.executable, "-m", "lipmotion.cli.main", "train", str(toy_corpus.path), "-o", "m.lipmotion"]
    with subprocess.Popen([*command, "--machine-readable"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        for line in process.stdout:
            if b"pronunciations" in line:
                break
        second = subprocess.run(command, capture_output=True, text=True, check=False)
        process.send_signal(number)
        rest, said = process.stdout.read(), process.stderr.read()
    assert process.returncode == 128 + number
    assert said.decode() == LINE + "\n"
    assert f'"exit_code": {128 + number}}}' in rest.decode().splitlines()[-1]
    assert second.returncode == 7
    assert f"another lipmotion (process {process.pid}) is at work on it" in second.stderr
    assert sorted(path.name for path in here.iterdir()) == ["m.lipmotion.unfinished", "whole.lipmotion"]
    assert [path.name for path in (here / "m.lipmotion.unfinished").iterdir()] == ["phones.checkpoint"]
    assert run_outside("train", toy_corpus.path, "-o", "m.lipmotion").code == 0
    assert (here / "m.lipmotion").read_bytes() == (here / "whole.lipmotion").read_bytes()
    assert sorted(path.name for path in here.iterdir()) == ["m.lipmotion", "whole.lipmotion"]


def test_impatience_ends_it() -> None:
    """A second signal, later: at once, even where the first one is taken for nothing."""
    program = (
        "import time\n"
        "from lipmotion.cli.stop import Stopper\n"
        "Stopper().listen()\n"
        "while True:\n"
        "    try:\n"
        "        print('ready', flush=True)\n"
        "        time.sleep(60)\n"
        "    except KeyboardInterrupt: pass\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        time.sleep(1.5)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130
