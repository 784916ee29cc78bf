from cli.conftest import check_refused
from lipmotion.pipeline.training.prompts import prompts


def test_sentences_with_what_they_cover(run):
    done = run("corpus", "prompts", "--count", "3")
    found = prompts(count=3)
    assert (done.code, done.err) == (0, [])
    assert [line.split(None, 5)[5] for line in done.out[:3]] == [prompt.text for prompt in found.chosen]
    last = found.chosen[-1]
    assert f"phones {last.phones}/{found.phones}  diphones {last.diphones:4}/{found.diphones}" in done.out[2]
    assert done.out[3].startswith(
        f"3 of {found.sentences} sentences: {last.diphones / found.diphones:.0%} of all their diphones"
    )


def test_options(run, here, toy_corpus):
    (here / "mine.txt").write_text("Two qwrtzx.\nFive.\nPapa vxvx.\n")
    (here / "lexicon.txt").write_text("qwrtzx zh oy\n")
    done = run("corpus", "prompts", "--text", "mine.txt", "--lexicon", "lexicon.txt", "--have", toy_corpus.path)
    assert done.out[0].endswith("Two qwrtzx.")
    assert done.err == ["lipmotion: warning: left out 1 sentences for their words: vxvx"]


def test_nothing_new(run, here, toy_corpus):
    words = toy_corpus.utterance("toy00").words
    (here / "mine.txt").write_text(" ".join(words or ()))
    done = run("corpus", "prompts", "--text", "mine.txt", "--have", toy_corpus.path)
    assert (done.code, done.out) == (0, ["0 of 1 sentences: they add nothing"])


def test_what_cannot_be_used(run, here):
    for arguments, code, words in (
        (["--text", "missing.txt"], 3, "missing.txt: no such transcript file"),
        (["--have", "missing"], 4, "missing: no such corpus"),
        (["--count", "0"], 3, "0 prompts asked for, required at least 1"),
        (["--lexicon", "missing"], 3, "missing: no such lexicon file"),
    ):
        check_refused(run("corpus", "prompts", *arguments), code, words)
    assert not list(here.iterdir())
