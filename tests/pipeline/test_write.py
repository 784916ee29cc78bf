"""``pipeline.outputs.output``: one result, several files, all or none."""

import json
from dataclasses import replace
from typing import Any

import av
import numpy as np
import pytest

from lipmotion import read_motion, write
from lipmotion.articulation.delivery import close_on_frame_grid
from lipmotion.articulation.phone_targets import GESTURES
from lipmotion.errors import ExportError, InputError
from lipmotion.pipeline.outputs.motion_files import with_articulation
from lipmotion.types import Generation
from lipmotion_faces import Staging


def test_several_files_at_once(result, toy_model, toy_speech, tmp_path):
    paths = [tmp_path / name for name in ("a.json", "a.csv", "a.NPZ")]
    write(result, [paths[0], str(paths[1]), paths[2]], speech=toy_speech, model=toy_model)
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    for path in paths:
        motion, units = read_motion(path)
        assert motion.names == result.motion.names
        assert motion.rate_hz == 100
        assert motion.values == pytest.approx(result.motion.values, abs=1e-5)
        assert len(units) == (0 if path.suffix == ".csv" else len(result.units))


def test_files_say_where_they_come_from(result, toy_model, toy_speech, tmp_path):
    about = {"corpus": ["a", "b"], "licence": ["CC BY 4.0"], "attribution": ["Anna", "Ünal"], "minutes": 3}
    write(result, [tmp_path / "a.json"], speech=toy_speech, model=replace(toy_model, about=about))
    document = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert document["source"] == {"file": toy_speech.name}
    assert document["model"] == {"corpus": "a; b", "licence": "CC BY 4.0", "attribution": "Anna; Ünal"}


def test_a_recording_may_have_any_name(result, toy_model, tmp_path):
    write(result, [tmp_path / "a.json", tmp_path / "a.npz"], speech="Ünal 音 caf\udce9.wav", model=toy_model)
    document = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert document["source"] == {"file": "Ünal 音 caf\\udce9.wav"}
    assert len(read_motion(tmp_path / "a.npz")[1]) == len(result.units)


def test_another_rate(result, toy_model, tmp_path):
    write(result, [tmp_path / "a.json", tmp_path / "a.csv"], model=toy_model, rate_hz=30)
    for name in ("a.json", "a.csv"):
        motion, _ = read_motion(tmp_path / name)
        assert motion.rate_hz == 30
        assert motion.values == pytest.approx(close_on_frame_grid(result, 30).motion.resampled(30).values, abs=1e-5)


def test_a_video_with_its_sound(result, toy_speech, tmp_path):
    write(result, [tmp_path / "a.mp4"], speech=toy_speech, fps=10, staging=Staging(size=96))
    with av.open(str(tmp_path / "a.mp4")) as container:
        video, sound = container.streams.video[0], container.streams.audio[0]
        assert video.average_rate == 10
        assert video.frames == pytest.approx(result.motion.time_s[-1] * 10, abs=1.5)
        assert float(sound.duration * sound.time_base) == pytest.approx(result.motion.time_s[-1], abs=0.1)


def test_nothing_is_written_unless_everything_can_be(result, toy_model, toy_speech, tmp_path):
    (tmp_path / "folder.json").mkdir()
    plain = {"speech": toy_speech, "model": toy_model}
    odd = (replace(result.motion.channels[0], name="a,b"), *result.motion.channels[1:])
    broken = np.full_like(result.motion.values, np.nan)
    cases: list[tuple[Generation, str, dict[str, Any], type[Exception], str]] = [
        (result, "a.xyz", {}, ExportError, r"a.xyz: unknown format '.xyz'; required one of: .json .csv .npz "),
        (result, "missing/a.json", {}, ExportError, r"the folder .*missing does not exist; create it first"),
        (result, "folder.json", {}, ExportError, r"folder.json: is a folder"),
        (result, "a.mp4", {"speech": None}, ExportError, r"a video needs the recording: write\(..., speech=FILE\)"),
        (result, "a.json", {"rate_hz": 0.0}, InputError, r"frame rate is 0 a second, required 1 to 1000"),
        (result, "a.json", {"rate_hz": float("nan")}, InputError, r"frame rate is nan"),
        (result, "a.mp4", {"fps": -25.0}, InputError, r"frame rate is -25 "),
        (result, "a.mp4", {"fps": 1e-5}, InputError, r"frame rate is 1e-05"),
        (result, "a.mp4", {"staging": CLEAR}, ExportError, "cannot be transparent"),
        (result, "a.json", {"face": "nobody"}, InputError, "face"),
        (result, "a.json", {"channels": ["smile"]}, InputError, "no motion channel 'smile'"),
        (result.selected(["width"]), "a.mp4", {}, ExportError, r"a\.mp4: the motion has no channel 'opening' to draw"),
        (replace(result, motion=replace(result.motion, channels=odd)), "a.json", {}, ExportError, "'a,b' does not fit"),
        (replace(result, motion=replace(result.motion, values=broken)), "a.json", {}, ExportError, "not finite"),
    ]
    for given, bad, options, error, message in cases:
        with pytest.raises(error, match=message):
            write(given, [tmp_path / "good.csv", tmp_path / bad], **(plain | options))
        assert [path.name for path in tmp_path.iterdir()] == ["folder.json"]


def test_some_channels_to_one_file(result, toy_model, tmp_path):
    write(result, str(tmp_path / "a.csv"), model=toy_model, channels=["width", "opening"])
    motion, _ = read_motion(str(tmp_path / "a.csv"))
    assert motion.names == ("width", "opening")
    assert motion["opening"] == pytest.approx(result.motion["opening"], abs=1e-5)


@pytest.mark.parametrize("name", ["a.mov", "a%03d.png"])
def test_a_face_may_be_transparent_where_the_file_can_be(result, toy_model, toy_speech, tmp_path, name):
    staging = Staging(size=64, background="transparent")
    write(result, tmp_path / name, speech=toy_speech, model=toy_model, fps=2, face="man", staging=staging)
    first = min(tmp_path.iterdir())
    assert first.name == name.replace("%03d", "000")
    with av.open(str(first)) as container:
        stream = container.streams.video[0]
        assert (stream.height, stream.width) == (64, 64)
        assert stream.metadata.get("alpha_mode") == "1" or "a" in stream.codec_context.pix_fmt


CLEAR = Staging(background="transparent")


def test_articulatory_channels_are_written_where_they_are_asked_for(result, toy_speech, tmp_path):
    write(result, tmp_path / "a.json", speech=toy_speech, channels=["opening", "tongue", "teeth"])
    motion, _ = read_motion(tmp_path / "a.json")
    assert motion.names == ("opening", "tongue", "teeth")
    assert [channel.unit for channel in motion.channels] == ["eye_distance", "weight", "weight"]
    assert 0 <= motion["teeth"].min() < motion["teeth"].max() <= 1
    more = with_articulation(result)
    assert more.motion.names == (*result.motion.names, *GESTURES)
    assert more.variance.shape == more.motion.values.shape
    assert not more.variance[:, -1].any()


@pytest.mark.parametrize("temporary", [False, True])
def test_scenes_name_no_sound_that_will_be_gone(result, toy_speech, tmp_path, monkeypatch, temporary):
    named = []
    monkeypatch.setattr("lipmotion_faces.outputs.scenes.delivered_scene", lambda _: True)
    monkeypatch.setattr("lipmotion_faces.outputs.scenes.write_scene", lambda *_, sound: named.append(sound))
    write(result, [tmp_path / "a.glb"], speech=toy_speech, temporary=temporary)
    assert named == [None if temporary else toy_speech]
