import json
from collections import Counter
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion import Corpus
from lipmotion.errors import InputError
from lipmotion.pipeline.training.prompts import cover_greedily, find_units, prompts
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import PHONES, Lexicon, find_similar_lips
from lipmotion_faces.corpus.coverage import coverage, coverage_document, coverage_lines, phone_distances
from testing.toy import toy_utterances

WORDS = Lexicon({"pab": (("p", "aa", "b"),), "tib": (("t", "iy", "b"),), "zog": (("zh", "oy", "g"),)})


def corpus_of(folder: Path, *texts: str | None) -> Corpus:
    corpus = Corpus.create(folder)
    for utterance, text in zip(toy_utterances(max(len(texts), 3)), texts, strict=False):
        corpus.add(replace(utterance, words=tuple(text.split()) if text else None, phones=None))
    return corpus


def format_moods(path: Path, *lines: str) -> Path:
    path.write_text("\n".join(lines))
    return path


def test_counts_and_shares(tmp_path):
    corpus = corpus_of(tmp_path / "corpus", "pab")
    found = coverage(corpus, format_moods(tmp_path / "text", "pab", "tib", "pab tib"), lexicon=WORDS)
    phones, diphones, triphones = found.kinds
    assert (phones.needed, phones.covered) == (5, 3)
    assert phones.share == pytest.approx(8 / 12)
    assert [(unit.unit, unit.count) for unit in phones.missing] == [("iy", 2), ("t", 2)]
    assert [(unit.unit, unit.count) for unit in diphones.missing] == [
        *[("iy-b", 2), ("t-iy", 2)],
        *[("b-t", 1), ("sil-t", 1)],
    ]
    assert (diphones.needed, diphones.covered) == (8, 4)
    assert diphones.share == pytest.approx(1 - 6 / 15)
    assert diphones.missing[0].share == pytest.approx(2 / 15)
    assert triphones.share == pytest.approx(5 / 12)
    assert {unit.unit for unit in triphones.missing} == {"sil-t-iy", "t-iy-b", "iy-b-sil", "aa-b-t", "b-t-iy"}


def test_what_stands_in(tmp_path):
    corpus = corpus_of(tmp_path / "corpus", "pab pab tib")
    lexicon = Lexicon(WORDS.user | {"bad": (("b", "aa", "d"),), "dib": (("d", "iy", "m"),)})
    phones, diphones, triphones = coverage(corpus, format_moods(tmp_path / "text", "bad dib"), lexicon=lexicon).kinds
    stand_ins = {unit.unit: (unit.stand_in, unit.recorded) for unit in phones.missing}
    assert stand_ins["d"] == ("t", 1)
    assert stand_ins["m"][0] == find_similar_lips("m", {"p", "aa", "b", "t", "iy"}) == "p"
    nearest = {unit.unit: (unit.stand_in, unit.recorded) for unit in diphones.missing}
    assert nearest["sil-b"] == ("sil-p", 1)
    assert nearest["b-aa"] == ("p-aa", 2)
    assert nearest["d-iy"] == ("t-iy", 1)
    assert nearest["iy-m"] == ("iy-b", 1)
    assert {unit.unit: unit.stand_in for unit in triphones.missing}["d-iy-m"] == "t-iy-b"


def test_the_nearest_has_the_least_distance(tmp_path, toy_corpus):
    """Recomputed one by one, in plain Python."""
    distances, number = phone_distances(), {phone: n for n, phone in enumerate(PHONES)}
    lexicon = Lexicon()
    recorded: Counter[tuple[str, ...]] = Counter()
    for name in toy_corpus.names():
        phones = [p for word in toy_corpus.utterance(name).words or () for p in lexicon.pronunciations(word)[0]]
        recorded.update(zip(["sil", *phones[:-1]], phones, [*phones[1:], "sil"], strict=True))
    _, _, triphones = coverage(toy_corpus, format_moods(tmp_path / "text", "please judge the toys")).kinds
    assert triphones.missing

    def cost(wanted: tuple[str, ...], other: tuple[str, ...]) -> float:
        each = [distances[number[a], number[b]] for a, b in zip(wanted, other, strict=True)]
        return float(each[0] + 2 * each[1] + each[2])

    for unit in triphones.missing:
        wanted, chosen = tuple(unit.unit.split("-")), tuple(unit.stand_in.split("-"))
        assert cost(wanted, chosen) == pytest.approx(min(cost(wanted, other) for other in recorded))
        assert unit.recorded == recorded[chosen]


def test_labelled_phones_count_and_silence_divides_them(tmp_path):
    corpus = Corpus.create(tmp_path / "corpus")
    utterance = toy_utterances(3)[0]
    names = ["sil", "p", "aa", "sp", "b", "sil"]
    step_s = utterance.audio.duration_s / len(names)
    spans = tuple(Span(n * step_s, (n + 1) * step_s, Unit(name)) for n, name in enumerate(names))
    corpus.add(replace(utterance, phones=Timeline(spans), words=("tib",)))
    phones, diphones, _ = coverage(corpus, format_moods(tmp_path / "text", "pab tib"), lexicon=WORDS).kinds
    assert {unit.unit for unit in phones.missing} == {"t", "iy"}
    assert "aa-b" in {unit.unit for unit in diphones.missing}
    assert "p-aa" not in {unit.unit for unit in diphones.missing}


def test_everything_is_covered(tmp_path):
    corpus = corpus_of(tmp_path / "corpus", "pab tib")
    found = coverage(corpus, format_moods(tmp_path / "text", "pab tib"), lexicon=WORDS)
    assert [(kind.covered, kind.missing) for kind in found.kinds] == [(5, ()), (7, ()), (6, ())]
    assert all(kind.share == pytest.approx(1) for kind in found.kinds)


def test_sentences_of_the_package_and_what_is_not_counted(tmp_path):
    corpus = corpus_of(tmp_path / "corpus", "see bob", "qwrtzx", None)
    found = coverage(corpus)
    assert (found.utterances, found.unknown, found.left_out) == (3, 2, {})
    assert [kind.needed for kind in found.kinds[:2]] == [42, 1047]
    assert found.kinds[0].share > found.kinds[1].share > found.kinds[2].share > 0


def test_text_is_bounded_and_json_holds_everything(tmp_path):
    found = coverage(corpus_of(tmp_path / "corpus", "see bob"))
    lines = list(coverage_lines(found, 5))
    assert len(lines) == 4 + 3 * (2 + 5 + 1)
    assert max(map(len, lines)) < 80
    missing = [len(kind.missing) - 5 for kind in found.kinds]
    assert [line for line in lines if line.startswith("and ")] == [
        f"and {count} more {kind.kind}" for count, kind in zip(missing, found.kinds, strict=True)
    ]
    document = json.loads(json.dumps(coverage_document(found)))
    assert [len(kind["missing"]) for kind in document["kinds"]] == [len(kind.missing) for kind in found.kinds]
    assert set(document["kinds"][0]["missing"][0]) == {"unit", "count", "share", "stand_in", "recorded"}


SETS = st.lists(st.sets(st.integers(0, 11), min_size=1), min_size=1, max_size=8)


def plain_cover(sets, costs, worth, count):
    """Recompute every gain in every step."""
    left, taken = list(worth), []
    while len(taken) < count:
        gains = [sum(left[e] for e in elements) / cost for elements, cost in zip(sets, costs, strict=True)]
        best = int(np.argmax(gains))
        if gains[best] == 0:
            break
        taken.append(best)
        for element in sets[best]:
            left[element] = 0
    return taken


@given(SETS, st.data())
def test_the_lazy_cover_is_the_greedy_one(sets, data):
    costs = [data.draw(st.sampled_from([1.0, 2.0, 4.0])) for _ in sets]
    worth = [data.draw(st.sampled_from([0.0, 1.0, 2.0, 8.0])) for _ in range(12)]
    arrays = [np.array(sorted(elements)) for elements in sets]
    for count in (1, 3, 20):
        assert cover_greedily(arrays, costs, np.array(worth), count) == plain_cover(sets, costs, worth, count)


@given(SETS)
def test_it_is_near_the_best_cover_there_is(sets):
    """Of k sets, a greedy choice covers at least 1 - 1/e of what any k cover (Nemhauser, Wolsey, Fisher 1978)."""
    arrays = [np.array(sorted(elements)) for elements in sets]
    chosen = cover_greedily(arrays, [1.0] * len(sets), np.ones(12), 3)
    covered = len(set().union(*(sets[i] for i in chosen)))
    best = max(len(set().union(*some)) for some in permutations(sets, min(3, len(sets))))
    assert covered >= (1 - 1 / np.e) * best


def test_units_of_a_word():
    assert find_units(("t", "uw")) == {
        *[("phone", "t"), ("phone", "uw")],
        *[("diphone", "sil", "t"), ("diphone", "t", "uw"), ("diphone", "uw", "sil")],
        *[("beside", "[sip]-t"), ("beside", "t+[lr2]"), ("beside", "[al]-uw"), ("beside", "uw+[sip]")],
    }


def test_the_list_in_the_package():
    found = prompts(count=1000)
    assert found.left_out == {}
    assert found.sentences >= 300
    assert found.phones == 42  # all that the dictionary uses; it has no em, en, el
    texts = [prompt.text for prompt in found.chosen]
    assert len(set(texts)) == len(texts)
    assert (found.chosen[-1].phones, found.chosen[-1].diphones) == (found.phones, found.diphones)
    assert found.diphones > 1000
    for text in texts:
        assert 5 <= len(text.split()) <= 10


def test_coverage_is_what_the_sentences_hold():
    lexicon = Lexicon()
    seen = set()
    for prompt in prompts(count=15).chosen:
        words = prompt.text.lower().replace(",", "").replace(".", "").replace("?", "").split()
        before = len(seen)
        seen |= find_units([phone for word in words for phone in lexicon.pronunciations(word)[0]])
        assert len(seen) > before
        assert prompt.phones == sum(unit[0] == "phone" for unit in seen)
        assert prompt.diphones == sum(unit[0] == "diphone" for unit in seen)


def test_a_text_of_ones_own(tmp_path):
    path = tmp_path / "mine.txt"
    path.write_text("Two.\nTwo two.\n\n---\nTea for two.\nTwo.\nTwo qwrtzx.\n")
    found = prompts(path)
    assert found.left_out == {"Two qwrtzx.": "qwrtzx"}
    assert found.sentences == 3
    assert [prompt.text for prompt in found.chosen] == ["Two.", "Tea for two.", "Two two."]
    with_lexicon = prompts(path, lexicon=Lexicon({"qwrtzx": (("zh", "oy"),)}))
    assert (with_lexicon.left_out, with_lexicon.sentences) == ({}, 4)


def test_what_is_recorded_is_not_asked_for_again(toy_corpus, tmp_path):
    path = tmp_path / "mine.txt"
    said = [" ".join(toy_corpus.utterance(name).words or ()) for name in toy_corpus.names()]
    path.write_text("\n".join([*said, "tea now"]))
    found = prompts(path, have=toy_corpus)
    assert [prompt.text for prompt in found.chosen] in ([], ["tea now"])
    path.write_text("\n".join([*said, "thirty judges"]))
    (only,) = prompts(path, have=toy_corpus).chosen
    assert only.text == "thirty judges"
    assert only.diphones > len(find_units("th er t iy jh ah jh ix z".split())) / 4  # what is recorded counts as covered


@pytest.mark.parametrize(
    ("content", "count", "message"),
    [
        ("", 5, "no sentence to choose from; required: a sentence a line"),
        ("qwrtzx\n", 5, "'qwrtzx' is not in the dictionary: --lexicon"),
        ("Hello.\n", 0, "0 prompts asked for"),
        (None, 5, "no such transcript file"),
    ],
)
def test_what_cannot_be_used(tmp_path, content, count, message):
    if content is not None:
        (tmp_path / "mine.txt").write_text(content)
    with pytest.raises(InputError, match=message):
        prompts(tmp_path / "mine.txt", count=count)
