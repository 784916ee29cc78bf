import shutil
from collections.abc import Iterator
from dataclasses import replace

import pytest

from cli.conftest import check_refused
from lipmotion import Corpus, Model, adapt, load_model, read_motion, save_model
from lipmotion.pipeline.training.other_speakers import SpokenSentence
from lipmotion.pipeline.training.train import TrainReport
from lipmotion.speech.voices.synthesiser import SyntheticVoice
from lipmotion.units import load_unit_set
from studio.toy_recordings import SENTENCES, write_recordings
from testing.toy import toy_sentences


@pytest.mark.long
def test_a_model_and_what_it_was_made_of(run, toy_corpus, here):
    done = run("train", toy_corpus.path, "-o", "mine.lipmotion")
    use = "use it: lipmotion animate SPEECH -o FILE --model mine.lipmotion"
    assert done == (0, [f"mine.lipmotion: 8 used, 0.3 minutes, 0 skipped; {use}"], [])
    assert [path.name for path in here.iterdir()] == ["mine.lipmotion"]
    made = load_model(here / "mine.lipmotion")
    assert made.prior is not None
    assert (made.engine.name, made.about["split"]) == ("trajectory", "train")


@pytest.mark.long
def test_speakers_are_chosen(run, toy_corpus, here):
    corpus = Corpus.create(here / "corpus")
    for name, speaker in zip(toy_corpus.names("train"), ("anna", "anna", "ben", "ben", "carl"), strict=False):
        corpus.add(replace(toy_corpus.utterance(name), speaker=speaker))
    done = run("train", "corpus", "-o", "m", "--from", "none", "--speaker", "anna", "--speaker", "ben")
    assert done.code == 0
    assert done.out[0].startswith("m: 4 used, 0.2 minutes, 0 skipped; ")
    assert load_model(here / "m").about["speakers"] == ["anna", "ben"]
    assert run("evaluate", "m", "corpus", "--speaker", "carl", "--split", "train").out[0].startswith("split train: 1 ")
    people = "speakers     anna (2, 5.5 seconds), ben (2, 5.1 seconds), carl (1, 2.8 seconds)"
    assert people in run("corpus", "info", "corpus").out


@pytest.mark.long
def test_what_is_given_wins_over_what_the_joint_engine_recognises(run, toy_corpus, toy_speech, here):
    own = ["--units", "eVis", "--set", "recognise_units=true", "--set", "mixtures=1"]
    assert run("train", toy_corpus.path, "-o", "m", "--engine", "joint", *own).code == 0
    assert load_model(here / "m").engine.name == "joint"
    assert "motion: " in "\n".join(run("info", "m", "--structure").out)
    told = {"alone": [], "right": ["--transcript", "see bob papa mama"]}
    for name, options in (told | {"again": ["--units", "alone.json"]}).items():
        assert run("animate", toy_speech, "--model", "m", "-o", f"{name}.json", *options).code == 0
    motion, units = zip(*(read_motion(here / f"{name}.json") for name in (*told, "again")), strict=True)
    alone, _, again = (one["opening"] for one in motion)
    assert again[:-30] == pytest.approx(alone[:-30], abs=1e-6)
    assert units[2] == units[0]
    phones = [" ".join(span.label.phone for span in one) for one in units]
    assert phones[1] == "sil s iy b aa b p aa p ax m aa m ax sil"
    assert {span.label.unit for span in units[0] if not span.label.phone} >= {"bilabial", "low"}


@pytest.mark.long
def test_units_of_a_table_that_is_not_needed_again(run, toy_corpus, here):
    units = load_unit_set("eVis")
    table = here / "mine.txt"
    table.write_text("".join(f"u{n} {' '.join(units.phones(unit))}\n" for n, unit in enumerate(units.units)))
    assert run("train", toy_corpus.path, "-o", "m", "--units", "mine.txt").code == 0
    table.unlink()
    assert set(load_model(here / "m").learned.units.units) == {f"u{n}" for n in range(19)}
    assert run("train", toy_corpus.path, "-o", "named", "--units", "eVis").code == 0
    assert load_model(here / "named").learned.units.unit_of_phone == units.unit_of_phone
    figures = [run("evaluate", name, toy_corpus.path).out for name in ("m", "named")]
    assert figures[0] == figures[1]


def test_other_voices_are_learned_from_but_those_for_judging(run, toy_model, toy_corpus, toy_speech, here, monkeypatch):
    """Of two installed voices, slt is held out; one friend was recorded."""
    speakers: list[list[str]] = []

    def say(*, voices: list[SyntheticVoice], **_: object) -> Iterator[SpokenSentence]:
        sentence = toy_sentences(3)[0]
        return (SpokenSentence(v.name, v.speaker, sentence.audio, sentence.units) for v in voices)

    def learn(*_: object, voices: Iterator[SpokenSentence], **__: object) -> tuple[Model, TrainReport]:
        speakers.append([one.speaker for one in voices])
        return toy_model, TrainReport((), {}, {})

    both = tuple(SyntheticVoice(name, "flite", name) for name in ("slt", "rms"))
    monkeypatch.setattr("lipmotion.pipeline.training.other_speakers.list_installed", lambda: both)
    monkeypatch.setattr("lipmotion.pipeline.training.other_speakers.synthesise_sentences", say)
    monkeypatch.setattr("lipmotion.pipeline.training.train.train", learn)
    (here / "open" / "friend").mkdir(parents=True)
    shutil.copy(toy_speech, here / "open" / "friend" / "one.wav")
    (here / "open" / "friend" / "one.txt").write_text(" ".join(toy_corpus.utterance("toy00").words or ()))
    for arguments in (["--voices", "--recordings", "open"], ["--voices"], []):
        assert run("train", toy_corpus.path, "-o", "m", "--engine", "coupled", *arguments).code == 0
    assert speakers == [["friend", "rms"], ["rms"], []]


@pytest.mark.long
def test_the_paper_s_system_learns_eigenlips_unless_told_otherwise(run, toy_corpus, here):
    for more, visual in ((("--system", "ph-vi-CHMM"), "eigenlips"), (("--visual", "geometry"), None)):
        assert run("train", toy_corpus.path, "-o", "m.lipmotion", "--force", "--preset", "xieliu2007", *more).code == 0
        model = load_model(here / "m.lipmotion")
        assert (model.about.get("visual"), model.eigenlips is not None) == (visual, visual is not None)
        assert (model.engine.config.conversion, model.engine.config.states) == ("em", 5)


@pytest.mark.long
def test_it_is_the_function_of_the_same_name(run, here, toy_speech, toy_model_file):
    done = run("adapt", toy_speech, "--model", toy_model_file, "-o", "voice.lipmotion")
    assert (done.code, done.err) == (0, [])
    assert done.out[0].startswith("voice.lipmotion: 1 recordings, ")
    assert done.out[0].endswith("s of speech; use it: lipmotion animate SPEECH -o FILE --model voice.lipmotion")
    save_model(adapt(load_model(toy_model_file), [toy_speech]), here / "same")
    assert (here / "same").read_bytes() == (here / "voice.lipmotion").read_bytes()
    said = dict(line.split(maxsplit=1) for line in run("info", "voice.lipmotion").out if len(line.split()) > 1)
    assert said["adapted"].startswith("recordings=1, speech_s=")
    assert run("animate", toy_speech, "--model", "voice.lipmotion", "-o", "m.json").code == 0


def test_info(run, toy_corpus):
    done = run("corpus", "info", toy_corpus.path)
    assert (done.code, done.err) == (0, [])
    summary = dict(line.split(maxsplit=1) for line in done.out)
    assert summary["utterances"] == "12 (8 train, 2 val, 2 test)"
    assert summary["transcribed"] == "12"
    assert summary["offset"].startswith("toy: ") or summary["offset"].startswith("corpus: ")


def test_motion_that_was_tracked_is_written_as_files(run, toy_corpus, here):
    done = run("corpus", "motion", toy_corpus.path, "-o", "natural", "--channels", "width,opening")
    assert done == (0, ["natural: the motion of 2 recordings"], [])
    for name in toy_corpus.names("test"):
        tracked, motion = toy_corpus.utterance(name).track.motion, read_motion(f"natural/{name}.json")[0]
        assert (motion.names, motion.rate_hz) == (("width", "opening"), tracked.rate_hz)
        assert motion.values == pytest.approx(tracked.selected(("width", "opening")).values, abs=1e-4)
    check_refused(run("corpus", "motion", toy_corpus.path, "-o", "other", "--channels", "pucker"), 3, "pucker")
    assert not (here / "other").exists()


@pytest.mark.long
def test_prepare_prints_the_counts(run, here):
    """What was prepared is kept, and what cannot be used is skipped."""
    recordings = write_recordings(here / "recordings")
    options = ("-o", "mine", "--workers", "2", "--no-crops", "--offset-ms", "-40")
    for counts in (f"{SENTENCES} prepared, 0 kept", f"0 prepared, {SENTENCES} kept"):
        done = run("corpus", "prepare", recordings, *options)
        assert (done.code, len(done.out)) == (0, 1)
        assert done.out[0].startswith(f"mine: {counts}, 1 skipped (")
        assert [line for line in done.err if line.startswith("lipmotion: warning: skipped empty: ")]
