"""``lipmotion live``."""

import csv
import json
import re
import signal
from pathlib import Path

import numpy as np
import pytest

from children import LIPMOTION, PIPE, child
from cli.conftest import RunCommand
from lipmotion_faces.characters.character_files import load_character
from meshes.heads import VISEMES, renamed, write_glb
from pipeline.made import read_welcome

WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"


def test_a_file_becomes_frames_on_the_command_line(run: RunCommand, tmp_path: Path) -> None:
    ran = run("live", WELCOME, "--to", tmp_path / "a.csv", "--to", "-", "--look-ahead", 80, "--as-fast-as-possible")
    assert ran.code == 0
    rows = list(csv.DictReader((tmp_path / "a.csv").read_text("utf-8").splitlines()))
    lines = [json.loads(line) for line in ran.out]
    assert len(rows) == len(lines) == pytest.approx(5.66 * 50, abs=2)
    for number, (row, line) in enumerate(zip(rows, lines, strict=True)):
        assert float(row["time_s"]) == pytest.approx(number * 0.02)
        assert float(row["known_s"]) - float(row["time_s"]) < 0.08
        assert float(row["opening"]) == pytest.approx(line["opening"], abs=1e-4)
    assert max(float(row["jawOpen"]) for row in rows) > 0.05


@pytest.mark.long
def test_raw_sound_comes_on_a_pipe(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes((read_welcome().samples[:32_000] * 32767).astype("<i2").tobytes())
    command = [*LIPMOTION, "live", "-i", "-", "--to", tmp_path / "a.csv"]
    with (tmp_path / "a.raw").open("rb") as sound, child(command, stdin=sound) as process:
        assert process.communicate()[0] == ""
        assert process.returncode == 0
    assert len((tmp_path / "a.csv").read_text("utf-8").splitlines()) == 101
    (tmp_path / "a.csv").unlink()
    with child([*command, "--to", "-"], stdin=PIPE) as process:
        assert process.stdin
        assert process.stdout
        process.stdin.write("\0" * 64_000)
        process.stdin.flush()
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
    assert (tmp_path / "a.csv").read_text("utf-8").startswith("time_s")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.raw"]
    (tmp_path / "a.wav").write_bytes(b"RIFF" + bytes(1_000))
    with (tmp_path / "a.wav").open("rb") as sound, child([*LIPMOTION, "live", "-i", "-"], stdin=sound) as process:
        assert (process.communicate()[0], process.returncode) == ("", 3)


@pytest.mark.long
def test_a_character_and_a_rig_get_their_own_curves(run: RunCommand, tmp_path: Path) -> None:
    """Lips that touch in the frames touch on a character of visemes."""
    spoken = {own: name.replace("viseme", "V") for own, name in VISEMES.items()}
    write_glb(tmp_path / "head.glb", renamed(spoken))
    (tmp_path / "rig.csv").write_text("control,source,gain\nChin.rotateX,jawOpen,-20\n")

    def curves(character: str) -> dict[str, np.ndarray]:
        basics = ("live", "-i", WELCOME, "--as-fast-as-possible", "--to", tmp_path / "a.csv")
        assert run(*basics, "--character", tmp_path / character).code == 0
        names, *rows = csv.reader((tmp_path / "a.csv").read_text("utf-8").splitlines())
        return dict(zip(names, np.array(rows, float).T, strict=True))

    mouth = load_character(tmp_path / "head.glb").shapes
    assert mouth is not None
    said = curves("head.glb")
    parted = sum(said[name] * gap for name, gap in zip(mouth.names, mouth.gap, strict=True))
    assert parted[said["opening"] < 0.001].max() < 0.003
    assert np.corrcoef(parted, said["opening"])[0, 1] > 0.5
    turned = curves("rig.csv")
    assert turned["Chin.rotateX"] == pytest.approx(-20 * turned["jawOpen"], abs=1e-3)


def test_what_is_wrong_is_said(run: RunCommand) -> None:
    for arguments, message in (
        (("-i", WELCOME, "--to", "nowhere"), "--to nowhere"),
        (("-i", WELCOME, "--look-ahead", "-5"), "-5"),
        (("-i", WELCOME, "--character", "nothing.glb"), "no such file"),
        (("-i", "no such microphone"), "sounddevice|microphone"),
        (("no such file.wav",), "no such file.wav: no such file; give a recording"),
    ):
        ran = run("live", *arguments)
        assert ran.code in (3, 8)
        assert re.search(message, "\n".join(ran.err))
