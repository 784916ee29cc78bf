import multiprocessing
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from lipmotion import Corpus, Model, Run, save_model, train
from lipmotion.engines import engine_named
from lipmotion.engines.coupled.training import chain_training as em_steps
from lipmotion.hmm.model import HmmConfig
from lipmotion.hmm.multistream import multistream_training
from lipmotion.pipeline import workers
from lipmotion.pipeline.model import BOTH, GEOMETRY
from lipmotion.pipeline.training import labels
from lipmotion.pipeline.training.labels import fingerprint_training
from lipmotion.stats import em
from lipmotion.types import Item, Monitor, Progress, silent_monitor
from lipmotion.units import Lexicon

CONFIG = HmmConfig(mixtures=2, iterations=1, context_frames=20)
Train = Callable[..., Model]


class Stopped(Exception):  # noqa: N818
    pass


def stopping_after(events: int) -> Monitor:
    reports: list[object] = []

    def monitor(event: Progress | Item) -> None:
        reports.append(event)
        if len(reports) == events:
            raise Stopped

    return monitor


@pytest.fixture
def few_utterances(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process has one of them to do, and a checkpoint two."""
    monkeypatch.setattr(workers, "UTTERANCES_PER_WORKER", 1)
    monkeypatch.setattr(labels, "UTTERANCES_PER_CHECKPOINT", 2)


@pytest.fixture
def work(tmp_path: Path) -> Path:
    folder = tmp_path / "work"
    folder.mkdir()
    return folder


@pytest.fixture(scope="module")
def corpus(toy_corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    """Five good utterances, and one whose words do not fit."""
    small = Corpus.create(tmp_path_factory.mktemp("resume") / "corpus")
    for name in toy_corpus.names("train")[:6]:
        utterance = toy_corpus.utterance(name)
        small.add(utterance if name != "toy02" else replace(utterance, words=("five",) * 100))
    return small


def run(corpus: Corpus, work: Path | None = None, monitor: Monitor = silent_monitor) -> Model:
    return train(corpus, recogniser=CONFIG, run=Run(work=work, monitor=monitor))[0]


def content(model: Model, folder: Path) -> bytes:
    save_model(model, folder / "model.lipmotion")
    return (folder / "model.lipmotion").read_bytes()


def create_events(corpus: Corpus, work: Path | None = None) -> list[Progress | Item]:
    events: list[Progress | Item] = []
    run(corpus, work, events.append)
    return events


@pytest.fixture(scope="module")
def whole(corpus: Corpus, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The model file of a training that nothing stops."""
    return content(run(corpus), tmp_path_factory.mktemp("whole"))


@pytest.mark.long
@pytest.mark.usefixtures("few_utterances")
def test_stopped_after_any_event(corpus, whole, work, tmp_path):
    count = len(create_events(corpus))
    assert count > 15
    for number in range(1, count + 1, 4):
        with pytest.raises(Stopped):
            run(corpus, work, stopping_after(number))
        assert content(run(corpus, work), tmp_path) == whole, number
        for path in work.iterdir():
            path.unlink()


@pytest.mark.long
def test_stopped_again_and_again(corpus, whole, work, tmp_path):
    """Every run gets some steps further than the one before."""
    stops = 0
    while True:
        try:
            model = run(corpus, work, stopping_after(8))
            break
        except Stopped:
            stops += 1
            assert stops < 50
    assert stops > 1
    assert content(model, tmp_path) == whole


@pytest.mark.long
@pytest.mark.parametrize(("name", "options"), [("joint", {}), ("coupled", {"chains": "sVis 2vis", "mixtures": 1})])
def test_finished_shards_are_not_summed_again(corpus, work, tmp_path, monkeypatch, name, options):
    """The E-steps of a training that is stopped are found again, under what their models and data are."""
    monkeypatch.setattr(em, "SAVE_S", 0.0)
    engine, computed = engine_named(name, options), []
    for module, function in ((multistream_training, "_shard_sums"), (em_steps, "_shard_sums")):
        usual = getattr(module, function)
        monkeypatch.setattr(module, function, lambda job, usual=usual: (computed.append(1), usual(job))[1])
    whole = content(train(corpus, recogniser=CONFIG, engine=engine)[0], tmp_path)
    count = len(computed)
    assert count > 3
    stop = next(i for i, e in enumerate(create_events(corpus)) if getattr(e, "share", 0) > 0.6) + 3
    with pytest.raises(Stopped):
        train(corpus, recogniser=CONFIG, engine=engine, run=Run(work=work, monitor=stopping_after(stop)))
    computed.clear()
    assert content(train(corpus, recogniser=CONFIG, engine=engine, run=Run(work=work))[0], tmp_path) == whole
    assert 0 < len(computed) < count


@pytest.mark.long
@pytest.mark.parametrize("what", ["corpus", "lexicon"])
def test_another_job_starts_over(corpus, work, tmp_path, what):
    run(corpus, work)
    options: dict[str, object] = {"recogniser": CONFIG}
    if what == "corpus":
        shutil.copytree(corpus.path, tmp_path / "other")
        corpus = Corpus.open(tmp_path / "other")
        utterance = corpus.utterance("toy01")
        values = utterance.features.values.copy()
        values[5, 5] += 0.1
        corpus.add(replace(utterance, features=replace(utterance.features, values=values)))
    else:
        options["lexicon"] = Lexicon({"papa": (("p", "ae", "p", "ax"),)})
    expected = content(train(corpus, **options)[0], tmp_path)  # type: ignore[arg-type]
    assert content(train(corpus, **options, run=Run(work=work))[0], tmp_path) == expected  # type: ignore[arg-type]


@pytest.mark.long
def test_a_damaged_checkpoint_is_not_used(corpus, whole, work, tmp_path):
    assert content(run(corpus, work), tmp_path) == whole
    for name in ("phones", "labels-0"):
        path = work / f"{name}.checkpoint"
        path.write_bytes(path.read_bytes()[:-500])
    assert content(run(corpus, work), tmp_path) == whole


@pytest.mark.long
@pytest.mark.usefixtures("few_utterances")
def test_threads_of_matrix_products_change_nothing(corpus, whole, tmp_path, monkeypatch):
    """Neither this process's own nor those that the processes it starts would use."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    with threadpool_limits(1, user_api="blas"):
        assert content(train(corpus, recogniser=CONFIG, run=Run(workers=2))[0], tmp_path) == whole
        assert {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"} == {1}


@pytest.mark.long
@pytest.mark.usefixtures("few_utterances")
def test_stopped_in_two_processes(corpus, whole, work, tmp_path):
    before = set(multiprocessing.active_children())
    with pytest.raises(Stopped):
        train(corpus, recogniser=CONFIG, run=Run(work=work, monitor=stopping_after(6), workers=2))
    assert set(multiprocessing.active_children()) == before
    assert content(train(corpus, recogniser=CONFIG, run=Run(work=work, workers=2))[0], tmp_path) == whole


def test_what_is_done_is_not_done_again(corpus, work):
    """What could not be used is reported again."""
    first, again = create_events(corpus, work), create_events(corpus, work)
    shares = [event.share for event in again if isinstance(event, Progress)]
    assert shares == sorted(shares)
    assert shares[0] >= 0.5  # of phones; motion is learned again
    assert shares[-1] <= 1
    items = [event for event in first if isinstance(event, Item)]
    assert [(item.name, item.outcome) for item in items] == [("toy02", "skipped")]
    assert "too short" in items[0].reason
    assert [event for event in again if isinstance(event, Item)] == items


def test_the_fingerprint_is_of_all_that_a_training_uses(toy_corpus, tmp_path):
    corpus = Corpus.create(tmp_path / "corpus")
    utterance = toy_corpus.utterance("toy00")
    engine, job = engine_named("trajectory", {}), (CONFIG, Lexicon())

    def digests() -> list[str]:
        return [fingerprint_training(corpus, ["toy00"], engine, *job, visual, None) for visual in (GEOMETRY, BOTH)]

    corpus.add(utterance)
    plain, pictured = digests()
    assert plain != pictured
    others = [
        fingerprint_training(corpus, [], engine, *job, GEOMETRY, None),
        fingerprint_training(corpus, ["toy00"], engine_named("trajectory", {"states": 3}), *job, GEOMETRY, None),
        fingerprint_training(corpus, ["toy00"], engine, replace(CONFIG, relevance=3.0), Lexicon(), GEOMETRY, None),
        fingerprint_training(corpus, ["toy00"], engine, CONFIG, Lexicon({"a": (("ax",),)}), GEOMETRY, None),
    ]
    assert len({plain, *others}) == 5
    crops = np.array(utterance.track.crops)
    crops[3, 4, 5] ^= 1
    corpus.add(replace(utterance, track=replace(utterance.track, crops=crops)))
    assert digests()[0] == plain  # mouth pictures count where eigenlips are learned from them
    assert digests()[1] != pictured
    corpus.add(replace(utterance, words=("papa",)))
    assert digests()[0] != plain
