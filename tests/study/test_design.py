from collections import Counter
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import av
import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.pipeline import job, request
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion_faces.video import mp4, synthetic_mark
from lipmotion_studio.study import answers, manifest
from lipmotion_studio.study.answers import ANCHOR, MOS, PAIRED
from lipmotion_studio.study.design import (
    design_study,
    encode_rated_video,
    make_condition,
    parse_conditions,
    read_sentences,
)
from lipmotion_studio.study.manifest import VIDEO_NAME, VIDEOS, check_videos, read_study
from lipmotion_studio.study.settings import StudySettings
from study.small_study import CONDITIONS, SENTENCES, sha256_of, small_study

DRAWN = job.Job(request.Request(), request.Outputs(face="portrait"))
PLAIN = StudySettings(practice=1, anchors=1, anchor_ms=100, checks=1)


def write_video(path: Path, shade: int, seconds: float = 0.4) -> None:
    """Write a video that gets brighter from left to right, with a tone that begins at once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    picture = np.zeros((48, 64, 3), np.uint8) + np.linspace(0, 200, 64).astype(np.uint8)[:, None]
    picture[..., 2] = shade
    sound = np.sin(np.arange(round(16_000 * seconds)) * 0.4).astype(np.float32) * 0.5
    mp4.write_mp4(path, [picture] * round(25 * seconds), fps=25, audio=types.Audio(sound, 16_000))


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with recordings of two sentences, and with finished videos of them."""
    for n, name in enumerate(("one", "two")):
        write_video(tmp_path / "said" / f"{name}.mp4", 10 + n)
        write_video(tmp_path / "ours" / f"{name}.mp4", 100 + n)
    return tmp_path


def test_a_paired_study_of_recordings_and_finished_videos(here):
    folder = here / "study"
    study = design_study(folder, PAIRED, ["recording", f"ours={here / 'ours'}"], [here / "said"], PLAIN)
    assert read_study(folder) == study
    assert sorted(path.name for path in folder.iterdir()) == ["study.json", "videos"]
    assert set(check_videos(study, folder)) == {path.name for path in (folder / VIDEOS).iterdir()}
    shown = {(video.sentence, video.condition) for video in study.videos}
    assert {pair for pair in shown if pair[1] != ANCHOR} == {
        (s, c) for s in ("one", "two") for c in ("recording", "ours")
    }
    assert len(study.trials) == 1 + 4 + 1 + 1  # practice, both orders of two sentences, anchor, check of attention
    (late,) = (video for video in study.videos if video.condition == ANCHOR)
    assert late.made == {"made": "recording", "sound_late_ms": "100"}
    ours = next(video for video in study.videos if (video.sentence, video.condition) == ("two", "ours"))
    assert ours.made["file_sha256"] == sha256_of(here / "ours" / "two.mp4")
    assert study.sentences["one"] == {"file": "one.mp4", "sha256": sha256_of(here / "said" / "one.mp4")}
    assert study.made_by["anchor_ms"] == "100"


def test_videos_are_what_browsers_play_and_their_names_say_nothing(here):
    study = design_study(here / "study", MOS, ["recording", f"ours={here / 'ours'}"], [here / "said"], PLAIN)
    assert len({video.file for video in study.videos}) == len(study.videos) == 5
    for video in study.videos:
        assert VIDEO_NAME.fullmatch(video.file)
        with av.open(str(here / "study" / VIDEOS / video.file)) as container:
            (picture,), (sound,) = container.streams.video, container.streams.audio
            assert (picture.codec_context.name, picture.codec_context.pix_fmt) == ("h264", "yuv420p")
            assert sound.codec_context.name == "aac"
        assert video.seconds == pytest.approx(0.4, abs=0.05)


def test_a_study_is_the_same_when_designed_again(here):
    conditions = ["recording", f"ours={here / 'ours'}"]
    first, second = (design_study(here / name, PAIRED, conditions, [here / "said"], PLAIN) for name in ("a", "b"))
    assert first == second
    other = design_study(here / "c", PAIRED, conditions, [here / "said"], replace(PLAIN, seed=5))
    assert other.trials != first.trials


@pytest.mark.long
def test_motion_is_drawn_with_the_sound_of_the_sentence(here):
    for name in ("one", "two"):
        (here / "motion").mkdir(exist_ok=True)
        rows = "".join(f"{n / 25},{0.1 * (n % 3)},0.5\n" for n in range(11))
        (here / "motion" / f"{name}.csv").write_text(f"time_s,opening,width\n{rows}", encoding="utf-8")
    study = design_study(here / "study", MOS, ["recording", f"drawn={here / 'motion'}"], [here / "said"], PLAIN)
    drawn = [video for video in study.videos if video.condition == "drawn"]
    assert [video.made["made"] for video in drawn] == ["drawn", "drawn"]
    assert [video.made["face"] for video in drawn] == ["portrait", "portrait"]
    assert read_audio(here / "study" / VIDEOS / drawn[0].file).duration_s == pytest.approx(0.4, abs=0.1)


def test_the_sound_of_an_anchor_is_late_and_its_length_stays(here):
    source = here / "said" / "one.mp4"
    seconds = [encode_rated_video(source, here / f"{ms}.mp4", source, ms) for ms in (0.0, 200.0)]
    assert seconds[0] == seconds[1]
    begins = []
    for ms in (0, 200):
        audio = read_audio(here / f"{float(ms)}.mp4")
        begins.append(int(np.argmax(np.abs(audio.samples) > 0.2)) / audio.rate_hz)
    assert begins[1] - begins[0] == pytest.approx(0.2, abs=0.03)
    with pytest.raises(errors.InputError, match="longer sentences"):
        encode_rated_video(source, here / "late.mp4", source, 5000.0)


def test_the_mark_of_a_synthetic_video_stays(here):
    source, mark = here / "said" / "one.mp4", synthetic_mark.mark_metadata()
    picture = np.zeros((48, 64, 3), np.uint8)
    mp4.write_mp4(here / "a.mp4", [picture] * 10, fps=25, audio=read_audio(source), tags=mark.tags, xmp=mark.xmp)
    for name, is_marked in (("a.mp4", True), ("said/one.mp4", False)):
        encode_rated_video(here / name, here / "shown.mp4", source)
        with av.open(str(here / "shown.mp4")) as container:
            assert (container.metadata.get("comment") == synthetic_mark.STATEMENT) == is_marked
        assert (synthetic_mark.SOURCE_TYPE.encode() in (here / "shown.mp4").read_bytes()) == is_marked


@pytest.mark.parametrize(
    ("conditions", "says"),
    [
        (["recording"], "at least 2"), (["recording", "recording"], "two conditions are called"),
        (["recording", "ours"], "required NAME=SOURCE"), (["recording", "=ours"], "required NAME=SOURCE"),
        (["anchor=x", "recording"], "no other"), (["real=recording", "recording"], "no other"),
    ],
)  # fmt: skip
def test_conditions_that_are_refused(conditions, says):
    with pytest.raises(errors.InputError, match=says):
        parse_conditions(conditions)


@pytest.mark.parametrize(
    ("prepare", "source", "says"),
    [
        (Path.exists, "nowhere", "no such model"),
        (lambda here: (here / "model.bin").touch(), "model.bin", "required a model"),
        (lambda here: (here / "empty").mkdir(), "empty", "add one.mp4 or one.json"),
        (lambda here: (here / "ours" / "one.mkv").touch(), "ours", "move one away"),
    ],
)
def test_sources_that_lack_something(here, prepare, source, says):
    prepare(here)
    said = read_sentences([here / "said"])
    with pytest.raises(errors.InputError, match=says):
        make_condition(str(here / source), said, DRAWN)


def test_what_is_there_is_not_replaced_and_a_failure_leaves_nothing(here):
    (here / "study").mkdir()
    with pytest.raises(errors.ExportError, match="exists"):
        design_study(here / "study", PAIRED, ["recording", f"ours={here / 'ours'}"], [here / "said"])
    (here / "ours" / "two.mp4").write_bytes(b"no video")
    before = set(here.iterdir())
    with pytest.raises(errors.InputError):
        design_study(here / "new", PAIRED, ["recording", f"ours={here / 'ours'}"], [here / "said"])
    assert set(here.iterdir()) == before


def test_two_sentences_of_one_name_are_refused(here):
    with pytest.raises(errors.InputError, match="two sentences are called 'one'"):
        read_sentences([here / "said", here / "ours" / "one.mp4"])


def test_recordings_without_pictures_cannot_be_shown():
    said = read_sentences([Path("examples/welcome.flac")])
    with pytest.raises(errors.InputError, match="has no pictures"):
        make_condition("recording", said, DRAWN)


@pytest.mark.long
def test_models_and_job_files_speak_the_sentences(tmp_path):
    (tmp_path / "still.toml").write_text('[request]\nrecogniser = "fast"\n[delivery]\nintensity = 0.2\n', "utf-8")
    conditions = ["full=shipped", f"weak={tmp_path / 'still.toml'}"]
    settings = replace(PLAIN, recogniser="fast", fps=10.0)
    study = design_study(tmp_path / "study", PAIRED, conditions, [Path("examples/welcome.flac")], settings)
    assert study.conditions["anchor"] == "full, sound 100 ms late"
    full, late, weak = (study.videos[n].made for n in range(3))
    assert full["model_sha256"] == weak["model_sha256"] == late["model_sha256"]
    assert weak["job_sha256"] == sha256_of(tmp_path / "still.toml")
    assert {video.sentence for video in study.videos} == {"welcome"}


SHOWN = {(sentence, name): n for n, (sentence, name) in enumerate((s, c) for s in SENTENCES for c in CONDITIONS)}


def test_the_trials_of_hofer_2008():
    """Three conditions and six sentences: every pair in both orders, 36 trials, no two alike."""
    trials = manifest.make_main_trials(answers.PAIRED, CONDITIONS, SENTENCES, SHOWN)
    assert len({trial.videos for trial in trials}) == len(trials) == 36
    names = {number: key for key, number in SHOWN.items()}
    shown = Counter(tuple(names[number] for number in trial.videos) for trial in trials)
    for sentence in SENTENCES:
        for first, second in permutations(CONDITIONS, 2):
            assert shown[(sentence, first), (sentence, second)] == 1
    firsts = Counter(names[trial.videos[0]][1] for trial in trials)
    assert set(firsts.values()) == {12}


def test_every_video_once_for_opinions():
    late = SHOWN | {("one", answers.ANCHOR): 100, ("two", answers.ANCHOR): 101}
    trials = manifest.make_main_trials(answers.MOS, CONDITIONS, SENTENCES, late)
    assert sorted(trial.videos[0] for trial in trials) == sorted(late.values())


def test_the_condition_in_step_is_expected_first_and_second():
    late = SHOWN | {("one", answers.ANCHOR): 100, ("two", answers.ANCHOR): 101}
    first, second = manifest.make_anchor_trials("phones", ("one", "two"), late)
    assert (first.videos, first.expected) == ((SHOWN["one", "phones"], 100), "first")
    assert (second.videos, second.expected) == ((101, SHOWN["two", "phones"]), "second")


@pytest.mark.parametrize("kind", answers.KINDS)
def test_a_check_of_attention_tells_the_answer_that_it_expects(kind):
    trials = manifest.make_main_trials(kind, CONDITIONS, SENTENCES, SHOWN)
    checks = manifest.make_attention_trials(kind, trials, 2, seed=1)
    assert len({check.expected for check in checks}) == 2
    for check in checks:
        assert check.expected in check.note


def test_each_rater_has_an_order_that_stays_and_orders_are_balanced(tmp_path):
    """A trial comes as often in the first half as chance has it: of 400 raters, 200 ± 4 standard deviations of 10."""
    study = small_study(tmp_path / "study")
    orders = [manifest.order_trials(study, rater) for rater in range(1, 30)]
    assert orders == [manifest.order_trials(study, rater) for rater in range(1, 30)]
    assert len({tuple(trial.videos for trial in order) for order in orders}) == 29
    for order in orders:
        assert order[0].practice
        assert Counter(order) == Counter(study.trials)
    counted = [trial for trial in study.trials if not trial.practice]
    early = Counter(
        trial for rater in range(400) for trial in manifest.order_trials(study, rater)[1 : 1 + len(counted) // 2]
    )
    assert all(160 <= early[trial] <= 240 for trial in counted)


def test_every_order_of_three_is_equally_likely():
    """Of 6000, 1000 each: chi-squared of five degrees of freedom is under 20.5 in 99.9 % of draws."""
    counts = Counter("".join(manifest.shuffle("abc", "seed", n)) for n in range(6000))
    assert len(counts) == 6
    assert sum((count - 1000) ** 2 / 1000 for count in counts.values()) < 20.5


def test_what_is_asked_names_the_conditions_as_they_are_shown(tmp_path):
    paired, opinions = small_study(tmp_path / "p"), small_study(tmp_path / "m", answers.MOS)
    trial = paired.trials[3]
    assert manifest.list_questions(paired, trial) == [
        ("preference", *(video.condition for video in paired.list_shown(trial)))
    ]
    asked = manifest.list_questions(opinions, opinions.trials[0])
    assert [question for question, _, _ in asked] == ["smoothness", "closure", "protrusion", "turning", "overall"]
