"""What all tests share: the toy corpus, a model of it, the real recordings where they are present."""

import os

# Before NumPy is loaded: two threads of a matrix product wait for one another in a loop, and for long where the machine
# has other work. It computes under ``kernels.compiler.limit_threads``; two threads: ``make test-portable``.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import ctypes
import gc
import signal
import sys
import time
import wave
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from lipmotion import Corpus, Model, load_model, save_model, train
from lipmotion.engines import engine_named
from lipmotion.errors import ExportError
from lipmotion.measures import curves
from lipmotion.motion import posterior_network
from lipmotion.storage.locks import lock_folder
from lipmotion_faces.filmed.face import FilmedFace, save_face  # also where no entry point is installed
from testing.heard import hear_once
from testing.toy import SMALL, ToySentence, toy_sentences, toy_utterances
from testing.toy_face import toy_face

if sys.platform == "linux":  # arrays of a megabyte go back to the system when they are freed: a worker runs 2,000 tests
    ctypes.CDLL(None).mallopt(-3, 1 << 20)  # M_MMAP_THRESHOLD
SENTENCES = 12
FIXED, EXPLORE = "fixed", "explore"
"""Profiles of Hypothesis: the same examples every time; and ``--hypothesis-profile=explore``: others, and more."""
MORE_SENTENCES = 10  # how many times the examples of a test are tried by ``explore``
# How long an example takes depends on what else the machine does; a fixture that examples share is never changed here.
ANYWHERE = settings(
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    print_blob=True,
)
settings.register_profile(FIXED, ANYWHERE, derandomize=True)
settings.register_profile(EXPLORE, ANYWHERE, derandomize=False, max_examples=100 * MORE_SENTENCES)
settings.load_profile(FIXED)

ENOUGH_STEPS = posterior_network.STEPS / 3
HASTY = {"cli", "docs", "experiments", "pipeline", "training"}
"""Folders of tests whose networks are trained for a few steps, and whose intervals are of a few draws."""
MEASURED_S = pytest.StashKey[float]()
"""Processor time of these tests, and of all processes that they waited for, when it was last looked at."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slowest", type=int, default=0, help="print so many tests that took most processor time")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Whatever needs real recordings, or trains on them, takes long; exploring tries more than a test asks for."""
    config.stash[MEASURED_S] = sum(os.times()[:4])
    for item in items:
        if item.get_closest_marker("recordings") or item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.long)
    if settings.get_current_profile_name() == EXPLORE:
        for test in {getattr(item, "obj", None) for item in items}:
            own = getattr(test, "_hypothesis_internal_use_settings", None)
            if own is not None and own.max_examples < settings().max_examples:
                test._hypothesis_internal_use_settings = settings(own, max_examples=MORE_SENTENCES * own.max_examples)


def pytest_collection_finish() -> None:
    """Five thousand tests live until the end: what lasts is looked through for garbage once, not at each collection."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A fixture counts for the first test that asks for it. What runs at the same time makes no test look slower."""
    report = yield
    before_s, item.config.stash[MEASURED_S] = item.config.stash[MEASURED_S], sum(os.times()[:4])
    report.processor_s = item.config.stash[MEASURED_S] - before_s  # type: ignore[attr-defined]
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    slowest = terminalreporter.config.getoption("--slowest")
    if slowest:
        used_s = Counter[str]()
        for reports in terminalreporter.stats.values():
            for report in reports:
                if isinstance(report, pytest.TestReport):
                    used_s[report.nodeid] += report.processor_s
        terminalreporter.section(f"processor seconds: {used_s.total():,.0f}, the {slowest} slowest of {len(used_s):,}")
        for name, used in used_s.most_common(slowest):
            terminalreporter.line(f"{used:6.1f}  {name}")


@pytest.fixture
def ordinary_signals() -> Iterator[None]:
    """Signals as a terminal leaves them: under ``nohup`` and in the background, tests are started with some ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler), signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    for number, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
        signal.signal(number, handler)


@pytest.fixture(scope="session", autouse=True)
def short_training() -> Iterator[None]:
    """The toy's motion follows so simply from its sound that a third of the steps of one network are enough."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(posterior_network, "STEPS", ENOUGH_STEPS)
        patched.setattr(posterior_network, "_train_recurrent", lambda *_: None)
        yield


@pytest.fixture(scope="module", autouse=True)
def hasty_training(request: pytest.FixtureRequest) -> Iterator[None]:
    """In some folders it counts what is trained and what is told of it, not how well it moves, nor how surely."""
    with pytest.MonkeyPatch.context() as patched:
        if HASTY & set(request.path.parts):
            patched.setattr(posterior_network, "STEPS", 4.0)
            few = partial(curves.compute_interval, draws=50)
            patched.setattr("lipmotion_lab.evaluation.evaluate.compute_interval", few)
        yield


@pytest.fixture(scope="module", autouse=True)
def released(request: pytest.FixtureRequest) -> Iterator[None]:
    """What a file of tests has cached goes with it, and what was freed to the system: glibc keeps up to 64 MB of it."""
    yield
    for value in vars(request.module).values():
        if getattr(value, "__module__", "") == request.module.__name__ and hasattr(value, "cache_clear"):
            value.cache_clear()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="session", autouse=True)
def heard_once() -> Iterator[None]:
    with hear_once():
        yield


@pytest.fixture(scope="session")
def toy_corpus(tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    """Eight sentences to train on, two to choose, two to test. Do not change it: copy it."""
    corpus = Corpus.create(tmp_path_factory.mktemp("corpus") / "toy")
    for utterance in toy_utterances(SENTENCES):
        corpus.add(utterance)
    return corpus


@pytest.fixture(scope="session")
def toy_sentence() -> ToySentence:
    """The first sentence, with the exact times of its phones."""
    return toy_sentences(3)[0]


def quickly(corpus: Corpus, engine: str = "trajectory", visual: str = "geometry", **options: Any) -> Model:
    """Return a model, trained in a second; its mouth does not move as English ones do."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(posterior_network, "STEPS", ENOUGH_STEPS)  # tests that ask for it first may be hasty
        return train(corpus, recogniser=SMALL, engine=engine_named(engine, options), visual=visual)[0]


def made_once(name: str, engine: str = "trajectory", visual: str = "geometry", **options: Any) -> Any:
    """Return fixtures: the file of a model that one worker trains for all, and the model in it."""

    def file(toy_corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> Path:
        base = tmp_path_factory.getbasetemp()
        path = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name / "toy.lipmotion"
        with ExitStack() as held:
            while not path.exists():
                with suppress(ExportError):  # another worker makes it
                    held.enter_context(lock_folder(path.parent))
                    break
                time.sleep(0.1)
            if not path.exists():
                save_model(quickly(toy_corpus, engine, visual, **options), path)
        return path

    def content(request: pytest.FixtureRequest) -> Model:
        return load_model(request.getfixturevalue(f"{name}_file"))

    session = partial(pytest.fixture, scope="session")
    return session(name=f"{name}_file")(file), session(name=name)(content)


toy_model_file, toy_model = made_once("toy_model", articulation=False)
coupled_model_file, coupled_model = made_once(
    "coupled_model", "coupled", chains="sVis 2vis", mixtures=2, articulation=False
)
joint_model_file, joint_model = made_once("joint_model", "joint")
pictured_model_file, pictured_model = made_once("pictured_model", visual="both")  # of lip distances and eigenlips


@pytest.fixture(scope="session")
def toy_speech(toy_sentence: ToySentence, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first sentence as a recording."""
    path = tmp_path_factory.mktemp("speech") / "toy speech é.wav"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(toy_sentence.audio.rate_hz)
        file.writeframes(np.round(toy_sentence.audio.samples * 32767).astype("<i2").tobytes())
    return path


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The real recordings; the test is skipped where they are absent."""
    folder = Path(__file__).parents[2] / "shared" / "corpora"
    if not folder.is_dir():
        pytest.skip("the real recordings are not here")
    return folder


@pytest.fixture(scope="session")
def filmed_face() -> FilmedFace:
    """The face of the drawn person, learned in two seconds; the toy model is of the same person."""
    return toy_face()


@pytest.fixture(scope="session")
def filmed_face_file(filmed_face: FilmedFace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("filmed_face") / "toy.face"
    save_face(filmed_face, path)
    return path
