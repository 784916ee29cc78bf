import json
import os
import signal
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

import lipmotion
from children import LIPMOTION, child, environment, run_child
from children import Done as Completed
from cli import signalled
from lipmotion.cli.terminal.events import Stopped, Stopper

LINE = "lipmotion: stopped; run the same command again to go on"
BOTH = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them"),
    pytest.mark.usefixtures("ordinary_signals"),
]


@BOTH
def test_a_signal_is_one_line_and_an_exit_code(run, make_info, number):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM), sys.excepthook

    def kill(_: Namespace) -> None:
        signal.raise_signal(number)
        raise AssertionError

    make_info(kill)
    assert run("info") == (128 + number, [], [LINE])
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM), sys.excepthook) == before


def test_an_error_that_follows_from_a_signal_is_not_shown(run, make_info):
    def kill(error: Exception, _: Namespace) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise error from None

    for error in (ImportError("cannot import"), OSError("interrupted"), ZeroDivisionError()):
        make_info(partial(kill, error))
        assert run("info") == (130, [], [LINE])


def test_a_second_signal_at_once_does_not_disturb_the_tidying_up(run, make_info):
    tidied = []

    def kill(_: Namespace) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGINT)
            tidied.append(True)

    make_info(kill)
    assert run("info").code == 130
    assert tidied == [True]


def test_an_ignored_signal_stays_ignored(make_info, run):
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        make_info(lambda _: signal.raise_signal(signal.SIGINT))
        assert run("info") == (0, [], [])
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_while_packages_are_imported(toy_speech, here):
    """The first package that is imported sends the signal, before the program has printed anything."""
    number = signal.SIGTERM
    (here / "numpy.py").write_text(f"import os\nos.kill(os.getpid(), {int(number)})\nwhile True: pass\n")
    first = environment(PYTHONPATH=os.pathsep.join([str(here), *sys.path]))
    done = run_child([*LIPMOTION, "animate", toy_speech, "-o", "a.json"], variables=first)
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", LINE + "\n")
    assert [path.name for path in here.iterdir() if path.name != "__pycache__"] == ["numpy.py"]


def test_a_second_signal_later_ends_the_program():
    """A second signal ends the program at once, even where the first one was swallowed."""
    program = (
        "import time\n"
        "from lipmotion.cli.terminal import events\n"
        "events.SAME_SIGNAL_S = 0.0\n"
        "events.Stopper().listen()\n"
        "while True:\n"
        "    try:\n"
        "        print('ready', flush=True)\n"
        "        while True: time.sleep(0.05)\n"
        "    except KeyboardInterrupt: pass\n"
    )
    with child([sys.executable, "-c", program]) as process:
        for _ in range(2):
            assert process.stdout.readline() == "ready\n"
            process.send_signal(signal.SIGINT)
        assert process.wait() == 130


def signalled_at(step: int, number: int, arguments: Sequence[object]) -> Completed:
    return run_child([sys.executable, signalled.__file__, int(number), step, *arguments])


def ends_with_one_final_event(done: Completed, number: int, events_only: bool) -> bool:
    """Return whether the last event, and only that, says how the command ended, in agreement with the exit code."""
    events = [json.loads(line) for line in (done.stderr if events_only else done.stdout).splitlines()]
    ends = [event for event in events if event["type"] in ("success", "failure")]
    stopped = done.returncode == 128 + number
    good = ends == events[-1:] and (ends[0]["type"] == "success") == (done.returncode == 0)
    if stopped:
        good &= ends[0]["reason"] == LINE.removeprefix("lipmotion: ") and (events_only or done.stderr == f"{LINE}\n")
    return good


@pytest.fixture
def lines(toy_speech: Path, toy_model_file: Path, here: Path) -> dict[str, tuple[list[object], bool, int]]:
    """Commands; whether standard error holds events only; and the exit code of an undisturbed run."""
    own = ["--model", toy_model_file, "--recogniser", "own"]
    return {
        "cues": (["cues", toy_speech, *own, "-o", here / "a.tsv", "--machine-readable"], True, 0),
        "train": (["train", here / "none", "-o", here / "m", "--machine-readable"], False, 4),
    }


@pytest.mark.long
@pytest.mark.parametrize("name", ["cues", "train"])
def test_whenever_the_signal_comes(name, lines, here):
    """From the first call to the end of Python: one final event says how the command ended, and no file is left."""
    arguments, events_only, code = lines[name]
    assert signalled_at(0, signal.SIGTERM, arguments).returncode == code
    steps = int((here / "steps").read_text())
    (here / "steps").unlink()
    early = [1, 20, steps // 2]
    late = [steps - 12, steps - 1, signalled.RETURN_MARK, signalled.CLEARANCE_MARK]
    codes = set()
    for turn, step in enumerate([*early, *late]):
        number = (signal.SIGINT, signal.SIGTERM)[turn % 2]
        done = signalled_at(step, number, arguments)
        assert done.returncode in (code, 128 + number), (step, done)
        assert (done.returncode == code) or step in range(1, steps), (step, done)
        assert ends_with_one_final_event(done, number, events_only), (step, done)
        assert {path.name for path in here.iterdir()} <= {"a.tsv"}
        codes.add(done.returncode)
    assert codes == {code, 130, 143}


@pytest.fixture
def stopper() -> Iterator[Stopper]:
    stopper = Stopper()
    stopper.listen()
    yield stopper
    stopper.stop_listening(process_ends=False)


def test_once_settled_a_signal_comes_too_late(stopper):
    stopper.settle()
    signal.raise_signal(signal.SIGTERM)
    stopper.check()
    stopper.settle()
    assert stopper.code is None


def test_what_was_swallowed_is_not_settled(stopper):
    with suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    with pytest.raises(Stopped):
        stopper.settle()
    assert stopper.code == 143


def test_little_is_loaded_before_signals_are_listened_to():
    """Before the handlers are installed, Python answers a signal with a traceback."""
    program = (
        "import sys; before = set(sys.modules); import lipmotion.cli.main; print(*sorted({*sys.modules} - before))"
    )
    source = environment(PYTHONPATH=str(Path(lipmotion.__file__).parents[1]))
    done = run_child([sys.executable, "-S", "-c", program], variables=source, check=True)
    loaded = set(done.stdout.split())
    assert {name for name in loaded if name.startswith("lipmotion")} == {
        "lipmotion", "lipmotion.cli", "lipmotion.cli.terminal", "lipmotion.cli.terminal.events", "lipmotion.cli.main",
    }  # fmt: skip
    assert not loaded & {"typing", "re", "json", "argparse", "logging", "numpy", "pathlib"}
