import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from cli.conftest import check_refused, is_one_error
from lipmotion import Corpus, Model, adapt, load_model, read_motion, save_model
from lipmotion.pipeline.training.other_speakers import SpokenSentence
from lipmotion.pipeline.training.prompts import prompts
from lipmotion.pipeline.training.train import TrainReport
from lipmotion.speech.voices.synthesiser import SyntheticVoice
from lipmotion.types import Audio
from lipmotion.units import load_unit_set
from pipeline.made import features_of, write_sound
from speech.made_voices import RATE_HZ, recorded_twice, speech_like
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
def test_what_was_left_out_is_said(run, toy_corpus, here):
    corpus = Corpus.create(here / "corpus")
    for name in toy_corpus.names("train")[:4]:
        utterance = toy_corpus.utterance(name)
        corpus.add(utterance if name != "toy02" else replace(utterance, words=("five",) * 100))
    done = run("train", "corpus", "-o", "mine.lipmotion", "--from", "none")
    assert done.code == 0
    assert done.out[0].startswith("mine.lipmotion: 3 used, 0.2 minutes, 1 skipped; ")
    (warning,) = done.err
    assert warning.startswith("lipmotion: warning: skipped toy02: ")


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
def test_a_system_of_the_coupled_engine(run, toy_corpus, here):
    wanted = ["--system", "ph-MSHMM", "--set", "chains=2vis", "--set", "acoustic_regression=no"]
    assert run("train", toy_corpus.path, "-o", "m", *wanted).code == 0
    config = load_model(here / "m").engine.config
    assert (config.structure, config.chains, config.acoustic_regression) == ("multistream", "2vis", False)


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


def test_sync(run, toy_corpus, here):
    """The sound of the toy corpus is made 120 ms late."""
    corpus = Corpus.create(here / "mine")
    for utterance in map(toy_corpus.utterance, toy_corpus.names()):
        late = Audio(np.append(np.zeros(1920), utterance.audio.samples), 16_000)
        corpus.add(replace(utterance, audio=late, features=features_of(late)))
    done = run("corpus", "sync", "mine")
    assert (done.code, done.err) == (0, [])
    assert re.fullmatch(r".*: sound moved by -1[1-5]\d ms", done.out[0])
    nothing = "mine: nothing moved: the sound is in step, or its offset could not be measured"
    assert run("corpus", "sync", "mine").out == [nothing]
    assert is_one_error(run("corpus", "sync", "missing"), 4)


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


def test_coverage(run, toy_corpus):
    done = run("corpus", "coverage", toy_corpus.path, "--count", "3")
    assert (done.code, done.err) == (0, [])
    found = json.loads(run("corpus", "coverage", toy_corpus.path, "--json").out[0])
    assert done.out[0] == f"{len(toy_corpus)} of {len(toy_corpus)} utterances, {found['sentences']} sentences"
    for line, kind in zip(done.out[1:4], found["kinds"], strict=True):
        assert line.split()[:4] == [kind["kind"], str(kind["covered"]), "of", str(kind["needed"])]
    assert f"and {len(found['kinds'][1]['missing']) - 3} more diphones" in done.out


def test_prompts(run, here, toy_corpus):
    done = run("corpus", "prompts", "--count", "3")
    found = prompts(count=3)
    assert (done.code, done.err) == (0, [])
    assert [line.split(None, 5)[5] for line in done.out[:3]] == [prompt.text for prompt in found.chosen]
    last = found.chosen[-1]
    assert f"phones {last.phones}/{found.phones}  diphones {last.diphones:4}/{found.diphones}" in done.out[2]
    share = last.diphones / found.diphones
    assert done.out[3].startswith(f"3 of {found.sentences} sentences: {share:.0%} of all their diphones")
    (here / "mine.txt").write_text(" ".join(toy_corpus.utterance("toy00").words or ()))
    done = run("corpus", "prompts", "--text", "mine.txt", "--have", toy_corpus.path)
    assert (done.code, done.out) == (0, ["0 of 1 sentences: they add nothing"])


def test_texts_and_lexicons_of_ones_own(run, here, toy_corpus):
    (here / "mine.txt").write_text("Two qwrtzx.\nFive.\nPapa vxvx.\n")
    (here / "lexicon.txt").write_text("qwrtzx zh oy\n")
    own = ("--text", "mine.txt", "--lexicon", "lexicon.txt")
    done = run("corpus", "prompts", *own, "--have", toy_corpus.path)
    assert done.out[0].endswith("Two qwrtzx.")
    assert done.err == ["lipmotion: warning: left out 1 sentences for their words: vxvx"]
    given = ["corpus", "coverage", toy_corpus.path, *own]
    done = run(*given)
    assert done.err == ["lipmotion: warning: left out 1 sentences for their words (--json has them)"]
    assert [line for line in done.out if line.startswith("zh ")]
    done = run(*given, "--json")
    assert done.err == []
    (document,) = map(json.loads, done.out)
    assert document["left_out"] == {"Papa vxvx.": "vxvx"}
    assert [kind["kind"] for kind in document["kinds"]] == ["phones", "diphones", "triphones"]


def test_offset_of_two_recordings(run, here):
    chance = np.random.default_rng(5)
    scene = np.concatenate([np.zeros(RATE_HZ), speech_like(chance, 3.0)])
    camera, recorder, _ = recorded_twice(scene, chance, 800, 7_200)
    write_sound(here / "camera.wav", camera)
    write_sound(here / "recorder.wav", recorder)
    done = run("corpus", "offset", "camera.wav", "recorder.wav")
    assert done.code == 0
    assert done.out[0].startswith("--offset-ms 500.0  (levels correlate by 0.")
