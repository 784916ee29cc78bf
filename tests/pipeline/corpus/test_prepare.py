import os
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion import Corpus, prepare
from lipmotion.errors import ExportError, InputError, MissingDependencyError
from lipmotion.pipeline.training.prompts import cover_greedily, find_units, prompts
from lipmotion.storage.locks import lock_folder
from lipmotion.types import Channel, Item, Motion, Progress, Span, Timeline, Track, Unit
from lipmotion.units import PHONES, Lexicon
from lipmotion_faces.corpus.coverage import measure_coverage, measure_phone_distances
from pipeline.made import replace_tracking, write_noise
from testing.toy import toy_utterances

SILENT = "nothing is said in its sound"  # noise of one level


@pytest.fixture
def studio(tmp_path: Path) -> Path:
    folder = tmp_path / "studio"
    for seed, name in enumerate(("a", "b", "c")):
        write_noise(folder / f"{name}.mp4", seed=seed)
    (folder / "a.txt").write_text("Hello, you.")
    return folder


@pytest.fixture
def tracked(monkeypatch) -> list[str]:
    """Replaces face tracking; lists the names of the videos it was asked for."""
    asked: list[str] = []

    def track(path: Path, *, crops: bool, tracker: str) -> Track:
        assert tracker == "mediapipe"
        asked.append(path.stem)
        if "broken" in path.stem:
            raise InputError(f"{path}: no face in 25 of 25 frames")
        if "strange" in path.stem:
            raise ZeroDivisionError("what is this")
        images = np.zeros((25, 56, 72, 3), np.uint8) if crops else None
        notes = ("cut at 0.50 s",) if "cut" in path.stem else ()
        return Track(Motion(np.ones((25, 1)), 25.0, (Channel("opening"),)), np.arange(25) > 1, images, notes)

    replace_tracking(monkeypatch, track)
    return asked


def content(corpus: Path) -> dict[str, bytes]:
    files = (path for path in sorted(corpus.rglob("*")) if path.is_file())
    return {str(path.relative_to(corpus)): path.read_bytes() for path in files}


@pytest.mark.usefixtures("tracked")
def test_recordings_become_a_corpus(studio, tmp_path):
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert report.kind == "folder of videos"
    assert report.prepared == ("a", "b", "c")
    assert (report.kept, report.failed) == ((), {})
    assert report.unseen == {"a": 2, "b": 2, "c": 2}
    assert report.seconds > 0
    found = Corpus.open(report.corpus).utterance("a")
    assert found.words == ("hello", "you")
    assert found.features.values.shape == (101, 39)
    assert found.track.motion.rate_hz == 25
    assert [found.source[name] for name in ("file", "bytes", "mediapipe")] == ["a.mp4", "32044", "0"]
    assert len(found.source["sha256"]) == 64


def test_what_is_up_to_date_is_kept_and_so_are_remarks(studio, tmp_path, tracked):
    write_noise(studio / "cut.mp4", seed=9)
    assert prepare(studio, tmp_path / "corpus", workers=1).notes["cut"] == ("cut at 0.50 s", SILENT)
    before = content(tmp_path / "corpus")
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert (report.prepared, report.kept) == ((), ("a", "b", "c", "cut"))
    assert report.unseen == {"a": 2, "b": 2, "c": 2, "cut": 2}
    assert report.notes == dict.fromkeys("abc", (SILENT,)) | {"cut": ("cut at 0.50 s", SILENT)}
    assert tracked == ["a", "b", "c", "cut"]
    assert content(tmp_path / "corpus") == before
    assert Corpus.open(report.corpus).utterance("cut").track.notes == ("cut at 0.50 s", SILENT)


@pytest.mark.usefixtures("tracked")
def test_what_is_damaged_or_has_changed_is_prepared_again_and_other_settings_prepare_all(studio, tmp_path):
    prepare(studio, tmp_path / "corpus", workers=1)
    before = content(tmp_path / "corpus")
    (tmp_path / "corpus" / "utterances" / "b" / "entry.json").write_text("{")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("b",)
    assert content(tmp_path / "corpus") == before
    write_noise(studio / "b.mp4", seed=77)
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("b",)
    (studio / "a.txt").write_text("Goodbye.")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("a",)
    (studio / "val.txt").write_text("c\n")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("c",)
    corpus = Corpus.open(tmp_path / "corpus")
    assert corpus.utterance("a").words == ("goodbye",)
    assert corpus.names("val") == ("c",)
    assert len(prepare(studio, tmp_path / "corpus", workers=1, crops=False).prepared) == 3
    assert Corpus.open(tmp_path / "corpus").utterance("a").track.crops is None


@pytest.mark.usefixtures("tracked")
def test_bad_recordings_are_listed_and_the_rest_is_prepared(studio, tmp_path):
    write_noise(studio / "broken.mp4", seed=5)
    write_noise(studio / "strange.mp4", seed=6)
    (studio / "empty.mp4").touch()
    (studio / "words.mp4").write_text("not a video")
    (studio / "c.txt").write_bytes(b"\x81")
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert report.prepared == ("a", "b")
    assert list(report.failed) == ["broken", "c", "empty", "strange", "words"]
    assert "no face in 25 of 25 frames" in report.failed["broken"]
    assert "ZeroDivisionError: what is this" in report.failed["strange"]
    assert "empty" in report.failed["empty"]
    assert Corpus.open(report.corpus).names() == ("a", "b")


@pytest.mark.usefixtures("tracked")
def test_utterances_of_recordings_that_are_gone_are_named(studio, tmp_path, caplog):
    prepare(studio, tmp_path / "corpus", workers=1)
    assert prepare(studio, tmp_path / "corpus", workers=1).kept == ("a", "b", "c")
    assert not caplog.records
    (studio / "a.mp4").unlink()
    (studio / "c.mp4").write_bytes(b"")
    assert prepare(studio, tmp_path / "corpus", workers=1).kept == ("b",)
    assert "2 utterances are from recordings that are no longer there, or cannot be used" in caplog.text
    assert "any longer: a, c;" in caplog.text


def test_missing_packages_are_reported_at_once(studio, tmp_path, monkeypatch):
    replace_tracking(monkeypatch, None)
    with pytest.raises(MissingDependencyError):
        prepare(studio, tmp_path / "corpus")
    assert not (tmp_path / "corpus").exists()


@pytest.mark.usefixtures("tracked")
def test_an_interrupted_run_goes_on_where_it_stopped(studio, tmp_path):
    prepare(studio, tmp_path / "whole", workers=1)

    def interrupt(event: Progress | Item) -> None:
        if isinstance(event, Item):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        prepare(studio, tmp_path / "corpus", workers=1, monitor=interrupt)
    assert Corpus.open(tmp_path / "corpus").names() == ("a",)
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert (report.kept, report.prepared) == (("a",), ("b", "c"))
    assert content(tmp_path / "corpus") == content(tmp_path / "whole")


@pytest.mark.usefixtures("tracked")
def test_another_speaker_may_use_the_same_names(studio, tmp_path):
    prepare(studio, tmp_path / "corpus", workers=1)
    other = tmp_path / "home"
    write_noise(other / "a.mp4", seed=50)
    shutil.copy(studio / "b.mp4", other / "b.mp4")  # the same recording: it is there already
    report = prepare(other, tmp_path / "corpus", workers=1)
    qualified = f"{tmp_path.name}-home-a"
    assert (report.prepared, report.kept) == ((qualified,), ("b",))
    assert prepare(other, tmp_path / "corpus", workers=1).kept == ("b", qualified)
    assert len(Corpus.open(tmp_path / "corpus")) == 4


@pytest.mark.usefixtures("tracked")
def test_two_at_a_time_are_refused(studio, tmp_path):
    with lock_folder(tmp_path / "corpus"):
        (tmp_path / "corpus" / ".part-of-the-other").touch()
        with pytest.raises(ExportError, match=rf"corpus: another lipmotion \(process {os.getpid()}\) is at work on it"):
            prepare(studio, tmp_path / "corpus", workers=1)
        assert (tmp_path / "corpus" / ".part-of-the-other").exists()
    assert len(prepare(studio, tmp_path / "corpus", workers=1).prepared) == 3
    assert [path.name for path in sorted((tmp_path / "corpus").iterdir())] == ["corpus.json", "utterances"]


WORDS = Lexicon({"pab": (("p", "aa", "b"),), "tib": (("t", "iy", "b"),), "zog": (("zh", "oy", "g"),)})


def corpus_of(folder: Path, *texts: str | None) -> Corpus:
    corpus = Corpus.create(folder)
    for utterance, text in zip(toy_utterances(max(len(texts), 3)), texts, strict=False):
        corpus.add(replace(utterance, words=tuple(text.split()) if text else None, phones=None))
    return corpus


def write_lines(path: Path, *lines: str) -> Path:
    path.write_text("\n".join(lines))
    return path


def test_counts_and_shares(tmp_path):
    corpus = corpus_of(tmp_path / "corpus", "pab")
    found = measure_coverage(corpus, write_lines(tmp_path / "text", "pab", "tib", "pab tib"), lexicon=WORDS)
    phones, diphones, triphones = found.kinds
    assert (phones.needed, phones.covered) == (5, 3)
    assert phones.share == pytest.approx(8 / 12)
    assert [(unit.unit, unit.count) for unit in phones.missing] == [("iy", 2), ("t", 2)]
    assert [(unit.unit, unit.count) for unit in diphones.missing[:2]] == [("iy-b", 2), ("t-iy", 2)]
    assert [(unit.unit, unit.count) for unit in diphones.missing[2:]] == [("b-t", 1), ("sil-t", 1)]
    assert (diphones.needed, diphones.covered) == (8, 4)
    assert diphones.share == pytest.approx(1 - 6 / 15)
    assert diphones.missing[0].share == pytest.approx(2 / 15)
    assert triphones.share == pytest.approx(5 / 12)
    assert {unit.unit for unit in triphones.missing} == {"sil-t-iy", "t-iy-b", "iy-b-sil", "aa-b-t", "b-t-iy"}


def test_the_nearest_has_the_least_distance(tmp_path, toy_corpus):
    """Recomputed one by one, in plain Python."""
    distances, number = measure_phone_distances(), {phone: n for n, phone in enumerate(PHONES)}
    lexicon = Lexicon()
    recorded: Counter[tuple[str, ...]] = Counter()
    for name in toy_corpus.names():
        phones = [p for word in toy_corpus.utterance(name).words or () for p in lexicon.pronunciations(word)[0]]
        recorded.update(zip(["sil", *phones[:-1]], phones, [*phones[1:], "sil"], strict=True))
    _, _, triphones = measure_coverage(toy_corpus, write_lines(tmp_path / "text", "please judge the toys")).kinds
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
    phones, diphones, _ = measure_coverage(corpus, write_lines(tmp_path / "text", "pab tib"), lexicon=WORDS).kinds
    assert {unit.unit for unit in phones.missing} == {"t", "iy"}
    assert "aa-b" in {unit.unit for unit in diphones.missing}
    assert "p-aa" not in {unit.unit for unit in diphones.missing}


def test_sentences_of_the_package_and_what_is_not_counted(tmp_path):
    corpus = corpus_of(tmp_path / "corpus", "see bob", "qwrtzx", None)
    found = measure_coverage(corpus)
    assert (found.utterances, found.unknown, found.left_out) == (3, 2, {})
    assert [kind.needed for kind in found.kinds[:2]] == [42, 1047]
    assert found.kinds[0].share > found.kinds[1].share > found.kinds[2].share > 0


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


def test_units_of_a_word():
    assert find_units(("t", "uw")) == {
        *[("phone", "t"), ("phone", "uw")],
        *[("diphone", "sil", "t"), ("diphone", "t", "uw"), ("diphone", "uw", "sil")],
        *[("beside", "[sip]-t"), ("beside", "t+[lr2]"), ("beside", "[al]-uw"), ("beside", "uw+[sip]")],
    }


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
