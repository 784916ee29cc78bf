from collections import Counter
from itertools import permutations

import pytest

from lipmotion_studio.study import answers, manifest
from study.small_study import CONDITIONS, SENTENCES, small_study

VIDEOS = {(sentence, name): n for n, (sentence, name) in enumerate((s, c) for s in SENTENCES for c in CONDITIONS)}


def test_the_trials_of_hofer_2008():
    """Three conditions and six sentences: every pair in both orders, 36 trials, no two alike."""
    trials = manifest.main_trials(answers.PAIRED, CONDITIONS, SENTENCES, VIDEOS)
    assert len({trial.videos for trial in trials}) == len(trials) == 36
    names = {number: key for key, number in VIDEOS.items()}
    shown = Counter(tuple(names[number] for number in trial.videos) for trial in trials)
    for sentence in SENTENCES:
        for first, second in permutations(CONDITIONS, 2):
            assert shown[(sentence, first), (sentence, second)] == 1
    firsts = Counter(names[trial.videos[0]][1] for trial in trials)
    assert set(firsts.values()) == {12}


def test_every_video_once_for_opinions():
    late = VIDEOS | {("two", answers.ANCHOR): 99}
    trials = manifest.main_trials(answers.MOS, CONDITIONS, SENTENCES, late)
    assert sorted(trial.videos[0] for trial in trials) == sorted(late.values())


def test_all_conditions_of_a_sentence_on_a_page_of_a_ranking():
    late = VIDEOS | {(sentence, answers.ANCHOR): 100 + n for n, sentence in enumerate(SENTENCES)}
    trials = manifest.main_trials(answers.RANKING, CONDITIONS, SENTENCES, late)
    assert [len(trial.videos) for trial in trials] == [4] * 6


def test_the_condition_in_step_is_expected_first_and_second():
    late = VIDEOS | {("one", answers.ANCHOR): 100, ("two", answers.ANCHOR): 101}
    first, second = manifest.anchor_trials("phones", ("one", "two"), late)
    assert (first.videos, first.expected) == ((VIDEOS["one", "phones"], 100), "first")
    assert (second.videos, second.expected) == ((101, VIDEOS["two", "phones"]), "second")


@pytest.mark.parametrize("kind", [answers.PAIRED, answers.MOS, answers.RANKING])
def test_a_check_of_attention_tells_the_answer_that_it_expects(kind):
    trials = manifest.main_trials(kind, CONDITIONS, SENTENCES, VIDEOS)
    checks = manifest.attention_trials(kind, trials, 2, seed=1)
    assert len({check.expected for check in checks}) == 2
    for check in checks:
        assert check.expected in check.note


def test_each_rater_has_an_order_that_stays(tmp_path):
    study = small_study(tmp_path / "study")
    orders = [manifest.order_trials(study, rater) for rater in range(1, 30)]
    assert orders == [manifest.order_trials(study, rater) for rater in range(1, 30)]
    assert len({tuple(trial.videos for trial in order) for order in orders}) == 29
    for order in orders:
        assert order[0].practice
        assert Counter(order) == Counter(study.trials)


def test_orders_are_balanced_over_raters(tmp_path):
    """A trial comes as often in the first half as chance has it: of 400 raters, 200 ± 4 standard deviations of 10."""
    study = small_study(tmp_path / "study")
    counted = [trial for trial in study.trials if not trial.practice]
    early = Counter(
        trial for rater in range(400) for trial in manifest.order_trials(study, rater)[1 : 1 + len(counted) // 2]
    )
    assert all(160 <= early[trial] <= 240 for trial in counted)


def test_every_order_of_three_is_equally_likely():
    """Of 6000, 1000 each: chi-squared of five degrees of freedom is under 20.5 in 99.9 % of draws."""
    counts = Counter("".join(manifest.shuffled("abc", "seed", n)) for n in range(6000))
    assert len(counts) == 6
    assert sum((count - 1000) ** 2 / 1000 for count in counts.values()) < 20.5


def test_a_ranking_shuffles_the_videos_of_a_page(tmp_path):
    study = small_study(tmp_path / "study", answers.RANKING)
    pages = {manifest.order_trials(study, rater)[0].videos for rater in range(40)}
    assert len(pages) > 10
    assert len({tuple(sorted(page)) for page in pages}) == 1


def test_what_is_asked_names_the_conditions_as_they_are_shown(tmp_path):
    paired, opinions = small_study(tmp_path / "p"), small_study(tmp_path / "m", answers.MOS)
    trial = paired.trials[3]
    assert manifest.list_questions(paired, trial) == [
        ("preference", *(video.condition for video in paired.shown(trial)))
    ]
    asked = manifest.list_questions(opinions, opinions.trials[0])
    assert [question for question, _, _ in asked] == ["smoothness", "closure", "protrusion", "turning", "overall"]
