import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from lipmotion import Job, Request
from lipmotion.pipeline.batch import BatchLine, check
from lipmotion.pipeline.batch.check import (
    MIN_LINES,
    CheckedLine,
    Finding,
    _find_problems,
    check_line,
    count_letters,
    estimate_time,
)

RATE_HZ = 16_000


def sound(path: Path, spoken_s: float, seed: int, level: float = 0.1) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    noise = np.random.default_rng(seed).normal(0, level, round(spoken_s * RATE_HZ))
    quiet = np.random.default_rng(seed).normal(0, level / 1000, RATE_HZ // 2)
    samples = (np.r_[quiet, noise, quiet].clip(-1, 1) * 32767).astype("<i2")
    wavfile.write(path, RATE_HZ, samples)


def test_every_kind_is_found(tmp_path):
    sounds = tmp_path / "sounds"
    words = "the old house at the end of the road"
    for seed, (name, spoken_s) in enumerate({"good": 2.2, "short": 0.6, "long": 9.0, "spanish": 2.2}.items()):
        sound(sounds / f"{name}.wav", spoken_s, seed)
    sound(sounds / "deep" / "silent.wav", 1.0, 5, level=1e-4)
    shutil.copy(sounds / "good.wav", sounds / "again.wav")
    (sounds / "broken.wav").write_text("no sound")
    sound(sounds / "deep" / "orphan.wav", 1.0, 6)
    sound(sounds / "made" / "output.wav", 1.0, 7)
    (sounds / "made" / "batch.jsonl").touch()
    listed = {name: f"{number} {words}" for number, name in enumerate(("good", "short", "long", "broken"))}
    listed |= dict.fromkeys(("deep/silent", "nowhere", "again"), "")
    listed["spanish"] = "la casa de los padres y el perro de la ni\u00f1a"
    script = "".join(f"sounds/{name}.wav,{text}\n" for name, text in listed.items())
    (tmp_path / "lines.csv").write_text(f"file,transcript\n{script}", encoding="utf-8")
    found = check(tmp_path / "lines.csv", jobs=1)
    assert [(each.kind, each.name) for each in found.findings] == [
        ("too short", "sounds/short"), ("too long", "sounds/long"), ("unreadable", "sounds/broken"),
        ("silent", "sounds/deep/silent"), ("missing", "sounds/nowhere"), ("language", "sounds/spanish"),
        ("same sound", "sounds/again"), ("orphaned", str(sounds / "deep" / "orphan.wav")),
    ]  # fmt: skip
    assert found.findings[5].text == "the words are in es, required en"
    assert found.text.startswith("8 lines: 1 too short, 1 too long, ")
    assert found.table.splitlines()[-1] == f"orphaned\t{sounds / 'deep' / 'orphan.wav'}\tno line has this recording"
    assert {path.name for path in tmp_path.iterdir()} == {"sounds", "lines.csv"}
    spanish = check(tmp_path / "lines.csv", Job(Request(language="es")), jobs=1)
    assert "sounds/spanish" not in {each.name for each in spanish.findings if each.kind == "language"}


def test_tags_are_no_words(tmp_path):
    sound(tmp_path / "a.wav", 1.0, 0)
    line = BatchLine("a", str(tmp_path / "a.wav"), "[angry] Who is <smile> there?")
    assert check_line(line, Request()).words == ("who", "is", "there")


def test_a_folder_has_no_orphans(tmp_path):
    sound(tmp_path / "a.wav", 1.0, 0)
    sound(tmp_path / "deep" / "b.wav", 1.0, 1)
    assert check(tmp_path, jobs=1).text == "2 lines: nothing found"


def test_the_measure_of_length_is_the_usual_rate():
    """What is too long among quick talkers is not among slow ones."""

    def lines(share: float) -> list[CheckedLine]:
        usual = [CheckedLine(f"{n}", spoken_s=share * estimate_time(60), letters=60) for n in range(MIN_LINES)]
        return [*usual, CheckedLine("x", spoken_s=2.6 * estimate_time(60), letters=60)]

    assert [each.name for each in _find_problems(lines(0.8), [])] == ["x"]
    assert list(_find_problems(lines(1.3), [])) == []
    assert count_letters(["hello", "\uac00"]) == pytest.approx(8.0)  # those of other scripts take longer


def test_short_lines_may_have_the_same_words():
    long, short = ("who", "goes", "there", "now"), ("yes", "sir")
    checked = [CheckedLine(name, words=words) for name, words in zip("abcd", (long, short, long, short), strict=True)]
    assert list(_find_problems(checked, [])) == [Finding("same words", "c", "as of a")]
