import json
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.copies import SETTINGS, renamed
from lipmotion import Corpus, Selection, evaluate, train
from lipmotion.errors import CorpusError, InputError
from lipmotion_lab import learning_curve as module
from lipmotion_lab.learning_curve import learning_curve
from lipmotion_lab.report.sections import learning_section
from lipmotion_lab.runner import ExperimentSettings
from testing.toy import SMALL

CONDITIONS = ["audio only", "with transcript"]


@pytest.fixture(scope="module")
def order(toy_corpus: Corpus) -> tuple[str, ...]:
    return toy_corpus.names("train")[::-1]


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, order: tuple[str, ...]) -> dict[str, Any]:
    return learning_curve(toy_corpus, order=order, sizes=[8, 4, 4], settings=SETTINGS)


@pytest.mark.long
def test_each_size_once_the_smallest_first(figures):
    assert [(row["names"], row["used"]) for row in figures["rows"]] == [(4, 4), (8, 8)]
    assert (figures["split"], figures["clips"], figures["order"]) == ("test", 2, "given")
    assert all(list(row["conditions"]) == CONDITIONS for row in figures["rows"])
    assert json.loads(json.dumps(figures, allow_nan=False))


@pytest.mark.long
def test_a_row_is_what_train_and_evaluate_say(figures, toy_corpus, order):
    names = sorted(order[: figures["rows"][0]["names"]])
    wanted = evaluate(train(toy_corpus, selection=Selection(names=names), recogniser=SMALL)[0], toy_corpus)
    assert figures["closed_under"] == wanted["closed_under"]
    for condition in CONDITIONS:
        made, said = figures["rows"][0]["conditions"][condition], wanted["conditions"][condition]
        opening = said["channels"]["opening"]
        assert [made[key] for key in ("acc", "nrmse", "global_variance")] == [
            opening[key] for key in ("acc", "nrmse", "global_variance")
        ]
        assert made["acc_95"] == pytest.approx(list(said["opening_acc_95"]))
        assert [made[f"acc_{name}"] for name in ("width", "outer")] == [
            said["channels"][name]["acc"] for name in ("width", "outer")
        ]


@pytest.mark.long
def test_minutes_are_those_of_the_utterances(figures, toy_corpus, order):
    seconds = [len(toy_corpus.utterance(name).audio.samples) / 16_000 for name in order]
    assert [row["minutes"] for row in figures["rows"]] == pytest.approx([sum(seconds[:4]) / 60, sum(seconds) / 60])


@pytest.mark.long
def test_channels_that_are_not_there_are_dashes(toy_corpus, tmp_path):
    made = learning_curve(renamed(toy_corpus, tmp_path, "opening", "smile"), sizes=[8], settings=SETTINGS)
    row = made["rows"][0]["conditions"]["audio only"]
    assert (row["acc_width"], row["acc_outer"]) == (None, None)
    assert learning_section(made).table.as_lines()[1].split()[-2:] == ["–", "–"]


def test_by_default_the_training_list_is_shuffled_and_no_finished_size_is_trained_again(
    toy_corpus, tmp_path, monkeypatch
):
    trained: list[list[str]] = []
    stops = [True]

    def result(_: object, names: Sequence[str], held_out: Sequence[str], *__: object) -> SimpleNamespace:
        trained.append(list(names))
        if len(names) == 8 and stops.pop():
            stops.append(False)
            raise KeyboardInterrupt
        assert tuple(held_out) == toy_corpus.names("test")
        return SimpleNamespace(recordings=SimpleNamespace(closed_under=0.1), clips={"audio only": []})

    monkeypatch.setattr(module, "SIZES", (3, 9))
    monkeypatch.setattr("lipmotion_lab.runner.train_and_generate", result)
    monkeypatch.setattr(module, "_row", lambda *_: {})
    received: list[tuple[str, str]] = []
    settings = ExperimentSettings(seed=1, receive=lambda *given: received.append(given[:2]))
    with pytest.raises(KeyboardInterrupt):
        learning_curve(toy_corpus, work=tmp_path, settings=settings)
    del trained[1:]
    figures = learning_curve(toy_corpus, work=tmp_path, settings=settings)
    assert [row["names"] for row in figures["rows"]] == [3, 8]
    assert received == [("3 recordings", "audio only"), ("8 recordings", "audio only")]
    names = toy_corpus.names("train")
    mixed = [names[i] for i in np.random.default_rng(1).permutation(8)]
    assert sorted(mixed[:3]) != list(names[:3])
    assert trained == [mixed[:3], mixed]
    assert (figures["order"], figures["seed"], figures["closed_under"]) == ("shuffled", 1, 0.1)


def test_what_cannot_be_trained_on(toy_corpus, tmp_path):
    for order, sizes, words in (
        ([], None, "the list of utterances to train on is empty; give one name a line"),
        (None, [], "sizes none; required: from 1 to 8"),
        (None, [4, 0], "sizes 0, 4; required: from 1 to 8"),
        (None, [9], "sizes 9; required: from 1 to 8, which is how many names the list has"),
        (["toy00", "toy01"], [2, 3], "sizes 2, 3; required: from 1 to 2"),
    ):
        with pytest.raises(InputError, match=words):
            learning_curve(toy_corpus, order=order, sizes=sizes)
    for order, words in (
        (["toy00", "nobody", "no-one"], r"2 of 3 names to train on \(no-one, nobody\) are not in the corpus"),
        (["x1", "x2", "x3", "x4", "x5", "x6"], r"6 of 6 names to train on \(x1, x2, x3, x4, x5, ...\) are not"),
        (["toy00", "toy11"], r"1 of 2 names to train on \(toy11\) are in the split that is compared with"),
        (["toy00", "toy01", "toy00"], r"1 of 3 names to train on \(toy00\) stand in the list more than once"),
    ):
        with pytest.raises(CorpusError, match=words):
            learning_curve(toy_corpus, order=order)
    with pytest.raises(CorpusError, match="no utterances of split 'tset'"):
        learning_curve(toy_corpus, split="tset")
    with pytest.raises(CorpusError, match="compared by the channel 'opening', which is not in it"):
        learning_curve(renamed(toy_corpus, tmp_path, "smile", "frown"))
