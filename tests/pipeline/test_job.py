import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lipmotion
from lipmotion import Delivery, Job, Outputs, Request, Staging, animate, load_model, write
from lipmotion.errors import InputError
from lipmotion.formats.label_files import write_labels
from lipmotion.pipeline.analysis.read_request import read_request
from lipmotion.pipeline.request import locate_paths
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Timeline
from lipmotion.units import Lexicon

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8").partition("\n## Jobs, and files of them")[2]
needs_toml = pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 reads no TOML")


def block(language: str) -> str:
    (found,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE.partition("\n## ")[0], re.MULTILINE | re.DOTALL)
    return str(found)


@needs_toml
def test_the_page_says_one_job_twice(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(block("toml"))
    names = {"lipmotion": lipmotion, "Path": Path}
    told = eval(block("python").partition("job = ")[2].partition("\nprint(")[0], names)  # noqa: S307
    job = Job.from_file("scene.toml")
    assert job == told
    assert job.request.recording == Path("examples/welcome.flac")
    assert (job.outputs.motion_hz, job.delivery.intensity, job.staging.head) == (25, 1.4, False)


@needs_toml
def test_paths_begin_at_the_folder_of_the_file(tmp_path):
    (tmp_path / "my.svg").write_text("<svg/>")
    file = tmp_path / "scene.toml"
    file.write_text(
        "[request]\nrecording = 'takes'\ntranscript = 'my words'\nmodel = '/else/m.lipmotion'\n"
        "[outputs]\nfiles = ['out/', '{name}.vtt', '-']\nface = 'my.svg'\ncurves = 'arkit'\n"
    )
    (tmp_path / "head").mkdir()
    assert locate_paths(Outputs(face="head/"), tmp_path).face == f"{tmp_path}/head"
    assert locate_paths(Outputs(face="head"), tmp_path).face == "head"
    (tmp_path / "anna").mkdir()
    assert locate_paths(Outputs(face="anna"), tmp_path).face == str(tmp_path / "anna")
    assert Job.from_file(file) == Job(
        Request(tmp_path / "takes", "my words", model=Path("/else/m.lipmotion")),
        Outputs((f"{tmp_path}/out/", f"{tmp_path}/{{name}}.vtt", "-"), face=str(tmp_path / "my.svg"), curves="arkit"),
    )


@needs_toml
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            "[request]\nrecordings = 'a.wav'",
            r"in \[request\]: no option 'recordings'; there are: recording, transcript",
        ),
        ("recording = 'a.wav'", "no option 'recording'; there are: request, outputs, delivery, staging"),
        ("delivery = 3", "delivery is 3, required a table of options"),
        ("[delivery]\nintensity = 4", r"in \[delivery\]: the intensity is 4, required 0 to 3"),
        ("[delivery]\nstepped = 'yes'", "stepped is 'yes', required true or false"),
        ("[outputs]\nfps = 0", "the frame rate is 0 a second, required 1 to 1000 a second"),
        ("[outputs]\nfiles = 'a.json'", "files is 'a.json', required a list of texts"),
        ("[outputs]\nchannels = [1]", "required a list of texts"),
        ("[outputs]\njaw = 'sound'", "jaw is 'sound', required one of: motion, energy, none"),
        ("[request]\nmodel = 1", "model is 1, required a path"),
        ("[request]\nasymmetry = nan", "the number nan, required a finite one"),
        ("[staging]\nsize = 63", "the size is 63 pixels"),
        ("[request", "Expected"),
        ("a = " + "[" * 100_000, "scene.toml"),
    ],
)
def test_what_a_file_cannot_say(tmp_path, content, words):
    (tmp_path / "scene.toml").write_text(content)
    with pytest.raises(InputError, match=words) as error:
        Job.from_file(tmp_path / "scene.toml")
    assert str(error.value).startswith(str(tmp_path / "scene.toml"))


def test_a_job_writes_what_animate_and_write_do(toy_speech, toy_model_file, tmp_path):
    made = [tmp_path / name for name in ("job.json", "calls.json")]
    outputs = Outputs((str(made[0]),), fps=30, channels=("width", "tongue"))
    delivery = Delivery(anticipation_ms=40)
    Job(Request(toy_speech, recogniser="own", model=toy_model_file), outputs, delivery).run()
    alone = animate(Request(toy_speech, recogniser="own"), model=toy_model_file)
    model = load_model(toy_model_file)
    how = {"rate_hz": 30, "channels": ("width", "tongue"), "delivery": delivery}
    write(alone, made[1], speech=toy_speech, model=model, **how)
    assert made[0].read_bytes() == made[1].read_bytes()


def test_a_field_is_a_file_or_what_it_holds(toy_sentence, toy_speech, tmp_path):
    (tmp_path / "words.txt").write_text("see bob")
    (tmp_path / "own.dict").write_text("SEE  S IY\n")
    write_labels(tmp_path / "phones.TextGrid", toy_sentence.units)
    files = Request(toy_speech, tmp_path / "words.txt", tmp_path / "own.dict", units=tmp_path / "phones.TextGrid")
    read = read_request(files)
    assert (read.transcript, read.recording) == ("see bob", toy_speech)
    assert isinstance(read.lexicon, Lexicon)
    assert isinstance(read.units, Timeline)
    assert [span.label.phone for span in read.units] == [span.label.phone for span in toy_sentence.units]
    assert read_request(read) == read
    named = replace(files, transcript=str(tmp_path / "words.txt"))
    assert read_request(named).transcript == "see bob"
    assert read_request(named, is_typed=False).transcript == str(tmp_path / "words.txt")
    with pytest.raises(InputError, match="lexicon: found a dict, required a path, or a Lexicon"):
        Request(toy_speech, lexicon={})  # type: ignore[arg-type]
    with pytest.raises(InputError, match="names no recording"):
        read_request(Request())


def test_a_job_of_a_sound_writes_it(toy_sentence, toy_model_file, tmp_path):
    request = Request(toy_sentence.audio, units=toy_sentence.units, model=toy_model_file)
    files = (str(tmp_path / "a.wav"), str(tmp_path / "a.csv"))
    made = Job(request, Outputs(files)).run()
    assert len(read_audio(tmp_path / "a.wav").samples) == len(toy_sentence.audio.samples)
    np.testing.assert_array_equal(made.motion.values, animate(request).motion.values)


def test_a_background_is_of_a_drawn_face_or_of_a_filmed_one(toy_speech):
    with pytest.raises(InputError, match="a video is for filmed faces"):
        Job(Request(toy_speech), Outputs(("a.mp4",), background="sea.mp4")).run()
    assert Staging(background="#40a0ff").colour == (64, 160, 255)
