from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.pipeline.training.prompts import cover_greedily, find_units, prompts
from lipmotion.units import Lexicon

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
