import faulthandler
import signal
import threading
from collections.abc import Iterator

import pytest

from cli.conftest import here, run, run_outside
from robustness import spoken_cases
from robustness.case import Bench
from speech import stand_in_voice

__all__ = ["bench", "here", "run", "run_outside", "stand_in", "watched"]
HANGS_S = 120


@pytest.fixture
def bench(
    tmp_path, toy_speech, toy_model_file, toy_corpus, coupled_model_file, pictured_model_file, filmed_face_file
) -> Bench:
    """Good inputs, and a folder in which bad ones are written."""
    folder = tmp_path / "bad"
    folder.mkdir()
    models = toy_model_file, toy_corpus.path, coupled_model_file, pictured_model_file
    return Bench(folder, toy_speech, *models, filmed_face_file)


@pytest.fixture(autouse=True)
def stand_in(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the stand-in the only synthesiser where texts are spoken."""
    case = getattr(request.node, "callspec", None)
    if case is not None and case.params["case"].group == spoken_cases.GROUP:
        stand_in_voice.install(monkeypatch)


@pytest.fixture(autouse=True)
def watched() -> Iterator[None]:
    """Stop a test that hangs: by an exception, or by ending the process where no exception is possible."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"still not done after {HANGS_S} s")

    if not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(HANGS_S)
    faulthandler.dump_traceback_later(2 * HANGS_S, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
