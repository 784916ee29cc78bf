from __future__ import annotations

import wave
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Corpus, prepare
from lipmotion.corpora.captured_faces import FLAME_MARKERS, FLAME_VERTICES, read_mesh_motion, read_vertices
from lipmotion.corpora.folder import discover
from lipmotion.errors import InputError
from meshes.flame import head

RATE_HZ, MESHES = 60.0, 30


def write_sentence(folder: Path, person: str, sentence: str) -> np.ndarray:
    """Write a sentence as VOCASET has it; return by how much the jaw is lowered, in millimetres [shape=(T,)]."""
    jaw = 8 * np.sin(np.linspace(0, np.pi, MESHES)) ** 2
    meshes, sound = folder / "unposedcleaneddata" / person / sentence, folder / "audio" / person / f"{sentence}.wav"
    for each in (meshes, sound.parent):
        each.mkdir(parents=True, exist_ok=True)
    for number, lowered in enumerate(jaw, 1):
        (meshes / f"{sentence}.{number:06}.ply").write_bytes(head(lowered, "<"))
    with wave.open(str(sound), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(22_000)
        file.writeframes(np.random.default_rng(1).integers(-9000, 9000, 11_000).astype("<i2").tobytes())
    return jaw


def test_vocaset_becomes_a_corpus_of_lip_distances(tmp_path: Path) -> None:
    for person in ("FaceTalk_170725_00137_TA", "FaceTalk_170728_03272_TA"):
        jaw = write_sentence(tmp_path / "voca", person, "sentence01")
    (tmp_path / "voca/audio/FaceTalk_170725_00137_TA/sentence01.txt").write_text("Hello there.")
    (tmp_path / "voca/audio/FaceTalk_170728_03272_TA/sentence02.wav").touch()
    report = prepare(tmp_path / "voca", tmp_path / "corpus", workers=1)
    assert report.prepared == ("FaceTalk_170725_00137_TA-sentence01", "FaceTalk_170728_03272_TA-sentence01")
    assert "no meshes (.ply)" in report.failed["FaceTalk_170728_03272_TA-sentence02"]
    corpus = Corpus.open(tmp_path / "corpus")
    assert list(corpus.speakers) == ["FaceTalk_170725_00137_TA", "FaceTalk_170728_03272_TA"]
    said = corpus.utterance(report.prepared[0])
    assert (said.words, said.track.motion.rate_hz, said.source["licence"][:8]) == (
        ("hello", "there"),
        RATE_HZ,
        "research",
    )
    motion = said.track.motion
    np.testing.assert_allclose(motion["opening"], (1 + jaw) / 90, atol=1e-6)
    np.testing.assert_allclose(motion["outer"], (16 + jaw) / 90, atol=1e-6)
    np.testing.assert_allclose(motion["width"], 46 / 90, atol=1e-6)
    np.testing.assert_allclose(np.ptp(motion["y_152"]), np.ptp(jaw) / 90, atol=1e-6)


def test_a_changed_mesh_prepares_again_and_a_missing_one_is_bridged(tmp_path: Path) -> None:
    jaw = write_sentence(tmp_path / "voca", "anna", "s01")
    prepare(tmp_path / "voca", tmp_path / "corpus", workers=1)
    assert prepare(tmp_path / "voca", tmp_path / "corpus", workers=1).kept == ("anna-s01",)
    meshes = tmp_path / "voca/unposedcleaneddata/anna/s01"
    (meshes / "s01.000001.ply").unlink()
    (meshes / "s01.000011.ply").unlink()
    assert prepare(tmp_path / "voca", tmp_path / "corpus", workers=1).prepared == ("anna-s01",)
    opening = Corpus.open(tmp_path / "corpus").utterance("anna-s01").track.motion["opening"]
    jaw[[0, 10]] = jaw[1], (jaw[9] + jaw[11]) / 2
    np.testing.assert_allclose(opening, (1 + jaw) / 90, atol=1e-6)


def test_bytes_in_either_order_and_text(tmp_path: Path) -> None:
    for order in ("<", ">", ""):
        (tmp_path / "a.ply").write_bytes(head(4, order))
        places = read_vertices(tmp_path / "a.ply", [FLAME_MARKERS["LIP_14"]])
        np.testing.assert_allclose(places, [[0, -0.065, 0.03]], atol=1e-6)


def test_other_meshes_are_refused(tmp_path: Path) -> None:
    good = head(0, "<")
    nan = np.float32(np.nan).tobytes() * 3 * FLAME_VERTICES
    for content, message in (
        (good.replace(b"vertex 5023", b"vertex 5000"), "5000 of 'vertex', required 5023 vertices: of others, no lip"),
        (good[:20_000], "not a mesh of FLAME in .ply"),
        (good.replace(b"float x", b"list uchar int x"), "not a mesh of FLAME in .ply"),
        (good.replace(b"float x", b"real x"), "not a mesh of FLAME in .ply"),
        (good.replace(b"property float x\n", b""), "not a mesh of FLAME in .ply"),
        (good.replace(b"format binary_little_endian 1.0\n", b""), "not a mesh of FLAME in .ply"),
        (good.replace(b"end_header", b"the_header"), "its header has no end"),
        (good[: good.index(b"end_header") + 11] + nan, "not finite"),
        (b"", "not a mesh of FLAME in .ply"),
    ):
        (tmp_path / "a.1.ply").write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_mesh_motion(tmp_path / "a.1.ply", RATE_HZ)


def test_only_the_two_folders_are_vocaset(tmp_path: Path) -> None:
    (tmp_path / "audio" / "anna").mkdir(parents=True)
    (tmp_path / "audio" / "anna" / "a.wav").touch()
    (tmp_path / "audio" / "anna" / "a.csv").touch()
    assert discover(tmp_path).kind == "folder of sounds with motion"
