import json

from cli.conftest import check_refused
from lipmotion_faces.corpus.coverage import coverage


def test_coverage_of_a_corpus(run, toy_corpus):
    done = run("corpus", "coverage", toy_corpus.path, "--count", "3")
    assert (done.code, done.err) == (0, [])
    found = coverage(toy_corpus)
    assert done.out[0] == f"{len(toy_corpus)} of {len(toy_corpus)} utterances, {found.sentences} sentences"
    for line, kind in zip(done.out[1:4], found.kinds, strict=True):
        assert line.split()[:4] == [kind.kind, str(kind.covered), "of", str(kind.needed)]
    assert f"and {len(found.kinds[1].missing) - 3} more diphones" in done.out


def test_options(run, here, toy_corpus):
    (here / "mine.txt").write_text("Two qwrtzx.\nFive.\nPapa vxvx.\n")
    (here / "lexicon.txt").write_text("qwrtzx zh oy\n")
    given = ["corpus", "coverage", toy_corpus.path, "--text", "mine.txt", "--lexicon", "lexicon.txt"]
    done = run(*given)
    assert done.err == ["lipmotion: warning: left out 1 sentences for their words (--json has them)"]
    assert [line for line in done.out if line.startswith("zh ")]
    done = run(*given, "--json")
    assert done.err == []
    (document,) = map(json.loads, done.out)
    assert document["left_out"] == {"Papa vxvx.": "vxvx"}
    assert [kind["kind"] for kind in document["kinds"]] == ["phones", "diphones", "triphones"]


def test_what_cannot_be_used(run, here, toy_corpus):
    for arguments, code, words in (
        ([toy_corpus.path, "--text", "missing.txt"], 3, "missing.txt: no such transcript file"),
        (["missing"], 4, "missing: no such corpus"),
        ([toy_corpus.path, "--lexicon", "missing"], 3, "missing: no such lexicon file"),
    ):
        check_refused(run("corpus", "coverage", *arguments), code, words)
    assert not list(here.iterdir())
