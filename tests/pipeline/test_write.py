"""``pipeline.outputs.output``: one result, several files, all or none."""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

import lipmotion
from lipmotion import Delivery, FilmedFace, Outputs, Request, animate, cues, read_motion, write, write_cues
from lipmotion.articulation.contact import find_closures
from lipmotion.articulation.cue_sheets import list_frame_shapes
from lipmotion.articulation.delivery import close_on_frame_grid
from lipmotion.articulation.rest import LAUGH_GAP
from lipmotion.errors import ExportError, InputError
from lipmotion.pipeline.outputs.curve_sets import make_curves, with_curves
from lipmotion.pipeline.outputs.deliver import deliver, hold_mouth_poses
from lipmotion.pipeline.outputs.motion_files import with_articulation
from lipmotion.pipeline.outputs.output import OutputSettings, create_outputs, plan, shift_prosody
from lipmotion.types import Audio, Constraints, Pin, Prosody, Timeline
from lipmotion.types.delivery import MoodKey
from lipmotion_faces import Staging
from lipmotion_faces.outputs import drawn_video
from lipmotion_faces.outputs.drawn_video import deliver_to_face
from lipmotion_faces.outputs.scenes import build_scene
from lipmotion_faces.outputs.shown_faces import ShownPerson, shown_face
from meshes.heads import head, write_glb
from pipeline.made import performed, read_character
from speech.made_voices import laugh, pulses, recording, said, vowels
from testing.toy import toy_sentences


def test_several_files_at_once_and_at_another_rate(result, toy_model, toy_speech, tmp_path):
    paths = [tmp_path / name for name in ("a.json", "a.csv", "a.NPZ")]
    write(result, [paths[0], str(paths[1]), paths[2]], speech=toy_speech, model=toy_model)
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    for path in paths:
        motion, units = read_motion(path)
        assert (motion.names, motion.rate_hz) == (result.motion.names, 100)
        assert motion.values == pytest.approx(result.motion.values, abs=1e-5)
        assert len(units) == (0 if path.suffix == ".csv" else len(result.units))
        write(result, path, model=toy_model, rate_hz=30)
        assert (motion := read_motion(path)[0]).rate_hz == 30
        assert motion.values == pytest.approx(close_on_frame_grid(result, 30).motion.resampled(30).values, abs=1e-5)


def test_pins_are_met_at_any_rate(toy_model, toy_speech, tmp_path):
    pins = Pin(1.23, "opening", 0.05), Pin(0.767, "width", 0.7), Pin(1.43, "jawOpen", 0.37), Pin(2, "browInnerUp", 0.9)
    generation = animate(toy_speech, model=toy_model, constraints=Constraints(pins))
    for rate_hz, curves, later_ms in product((24, 30, 60, 90, 120), (None, "face"), (0, 15)):
        write(generation, tmp_path / "a.csv", rate_hz=rate_hz, curves=curves, delivery=Delivery(offset_ms=later_ms))
        motion, _ = read_motion(tmp_path / "a.csv")
        for pin in pins[2:] if curves else pins[:2]:
            nearest = round((pin.time_s + later_ms / 1000) * rate_hz)
            assert motion[pin.channel][nearest] == pytest.approx(pin.value, abs=1e-5), (pin, rate_hz, later_ms)


def test_files_say_where_they_come_from_and_a_recording_may_have_any_name(result, toy_model, toy_speech, tmp_path):
    about = {"corpus": ["a", "b"], "licence": ["CC BY 4.0"], "attribution": ["Anna", "Ünal"], "minutes": 3}
    write(result, [tmp_path / "a.json"], speech=toy_speech, model=replace(toy_model, about=about))
    document = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert document["source"] == {"file": toy_speech.name}
    assert document["model"] == {"corpus": "a; b", "licence": "CC BY 4.0", "attribution": "Anna; Ünal"}
    write(result, [tmp_path / "a.json", tmp_path / "a.npz"], speech="Ünal 音 caf\udce9.wav", model=toy_model)
    assert json.loads((tmp_path / "a.json").read_text("utf-8"))["source"] == {"file": "Ünal 音 caf\\udce9.wav"}
    assert len(read_motion(tmp_path / "a.npz")[1]) == len(result.units)


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
    cases: list[tuple[Any, str, dict[str, Any], type[Exception], str]] = [
        (result, "a.xyz", {}, ExportError, r"a.xyz: unknown format '.xyz'; required one of: .json .csv .npz "),
        (result, "missing/a.json", {}, ExportError, r"the folder .*missing does not exist; create it first"),
        (result, "folder.json", {}, ExportError, r"folder.json: is a folder"),
        (result, "a.mp4", {"speech": None}, ExportError, r"a video needs the recording: write\(..., speech=FILE\)"),
        (result, "a.json", {"rate_hz": 0.0}, InputError, r"frame rate is 0 a second, required 1 to 1000"),
        (result, "a.json", {"rate_hz": float("nan")}, InputError, r"frame rate is nan"),
        (result, "a.mp4", {"fps": -25.0}, InputError, r"frame rate is -25 "),
        (result, "a.mp4", {"fps": 1e-5}, InputError, r"frame rate is 1e-05"),
        (result.motion, "a.json", {}, InputError, "the generation: found a Motion, required what animate returned"),
        (result, "a.json", {"delivery": "game"}, InputError, r"the delivery: found 'game', required Delivery\("),
        (result, "a.mp4", {"staging": CLEAR}, ExportError, "cannot be transparent"),
        (result, "a.json", {"face": "nobody"}, InputError, "face"),
        (result, "a.json", {"channels": "opening,smile"}, InputError, "no motion channel 'smile'"),
        (result.selected(["width"]), "a.mp4", {}, ExportError, r"a\.mp4: the motion has no channel 'opening' to draw"),
        (replace(result, motion=replace(result.motion, channels=odd)), "a.json", {}, ExportError, "'a,b' does not fit"),
        (replace(result, motion=replace(result.motion, values=broken)), "a.json", {}, ExportError, "not finite"),
    ]
    for given, bad, options, error, message in cases:
        with pytest.raises(error, match=message):
            write(given, [tmp_path / "good.csv", tmp_path / bad], **(plain | options))
        assert [path.name for path in tmp_path.iterdir()] == ["folder.json"]


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
    write(result, tmp_path / "a.json", speech=toy_speech, channels="opening,tongue,teeth")
    motion, _ = read_motion(tmp_path / "a.json")
    assert motion.names == ("opening", "tongue", "teeth")
    assert [channel.unit for channel in motion.channels] == ["eye_distance", "weight", "weight"]
    assert 0 <= motion["teeth"].min() < motion["teeth"].max() <= 1
    more = with_articulation(result)
    assert {*more.motion.names} > {*result.motion.names, "tongue", "teeth", "protrusion"}
    assert more.variance.shape == more.motion.values.shape
    assert not more.variance[:, -1].any()


@pytest.mark.long
@pytest.mark.parametrize("temporary", [False, True])
def test_scenes_name_no_sound_that_will_be_gone(result, toy_speech, tmp_path, temporary):
    write(result, [tmp_path / "a.usda"], speech=toy_speech, temporary=temporary)
    assert (toy_speech.name in (tmp_path / "a.usda").read_text()) != temporary


@pytest.fixture
def settings() -> OutputSettings:
    return OutputSettings(shown_face("portrait"), sounded=True)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.json", "MotionOutput"), ("a.LIVELINK.csv", "MotionOutput"), ("a.cues.json", "CueOutput"),
        ("a.Cues.TSV", "CueOutput"), ("cues.json", "MotionOutput"), ("a.mp4", "VideoOutput"), ("a.MOV", "VideoOutput"),
        ("a%05d.png", "PicturesOutput"), ("a.glb", "SceneOutput"), ("a.textgrid", "LabelOutput"),
        ("a.flac", "SoundOutput"),
    ],
)  # fmt: skip
def test_a_name_asks_for_a_kind(name, kind, settings):
    assert type(plan(name, settings)).__name__ == kind


def test_what_no_kind_writes_is_refused(settings, tmp_path):
    for name, meant in (("a.xyz", ""), ("in/a.png", "a.%05d.png, or "), ("a.TSV", "a.cues.tsv, or "), ("a", "")):
        with pytest.raises(ExportError, match=f"required {meant}one of: .json ") as error:
            plan(name, settings)
        assert {".json", ".mp4", ".glb", ".wav", "%05d.png", ".cues.tsv"} <= {*str(error.value).split()}
    with pytest.raises(ExportError, match=r"unknown format '\.wav'"):
        plan("a.wav", replace(settings, sounded=False))
    with pytest.raises(InputError, match="the frame rate is 101"):
        create_outputs([tmp_path / "a.cues.tsv"], replace(settings, outputs=Outputs(fps=101.0)))


def test_what_python_alone_draws_says_how_long_it_takes(monkeypatch, caplog):
    monkeypatch.setattr(drawn_video, "numba_works", lambda: False)
    assert [*drawn_video.report_cost(Path("a.mp4"), iter("abc"), 3)] == ["a", "b", "c"]
    (said,) = caplog.messages
    assert all(part in said for part in ("a.mp4: without numba its 3 pictures take about ", "pip install numba"))


def test_cues_beside_other_outputs_are_those_of_the_function(result, tmp_path):
    write(result, [tmp_path / "a.cues.tsv", tmp_path / "a.csv"])
    write_cues(cues(result), tmp_path / "b.tsv")
    assert (tmp_path / "a.cues.tsv").read_bytes() == (tmp_path / "b.tsv").read_bytes()
    with pytest.raises(InputError, match=r"the generation: found .*, required what animate returned"):
        cues("a.wav")  # type: ignore[arg-type]
    with pytest.raises(ExportError, match="has no phones"):
        cues(replace(result, units=Timeline(())))
    broken = result.motion.values.copy()
    broken[3, 0] = np.nan
    with pytest.raises(ExportError, match="not finite"):
        cues(replace(result, motion=replace(result.motion, values=broken)))


@pytest.mark.long
@pytest.mark.parametrize("late", [0, 37])
def test_each_line_of_a_stem_has_the_motion_and_the_cues_of_the_line_alone(toy_model, late):
    """Three lines at levels 15 dB apart, one of them with an offset, in digital silence; on the frames and beside them.

    Motion is that of the line alone but for rounding; within a line nothing follows from the others.
    """
    rng, rate_hz = np.random.default_rng(0), 16_000
    stem, lines = np.zeros(24 * rate_hz, np.float32), []
    for number, (decibels, offset) in enumerate(((0, 0.0), (-15, 0.002), (-30, 0.0))):
        said = np.pad(toy_sentences(3)[number].audio.samples, (rate_hz * number // 2, rate_hz // 2))
        line = 10 ** (decibels / 20) * (said + 1e-4 * rng.standard_normal(len(said))) + offset
        at = (2 + 8 * number) * rate_hz + late
        stem[at : at + len(line)] = line
        lines.append((2 + 8 * number, line.astype(np.float32)))
    together = lipmotion.animate(Audio(stem, rate_hz), model=toy_model)
    shown, opening, outside = list_frame_shapes(lipmotion.cues(together)), together.motion["opening"].copy(), 0.0
    for at_s, line in lines:
        alone = lipmotion.animate(Audio(line, rate_hz), model=toy_model)
        values, cues = alone.motion.values, list_frame_shapes(lipmotion.cues(alone))[:-2]
        frames = slice(100 * at_s, 100 * at_s + len(values))
        assert together.motion.values[frames] == pytest.approx(values, abs=0.005)
        assert any(shape != "X" for shape in cues)
        assert shown[24 * at_s :][: len(cues)] == cues
        opening[frames.start - 160 : frames.stop + 160] = outside = opening[0]
    assert opening == pytest.approx(outside)


@pytest.mark.long
@pytest.mark.parametrize("offset_ms", [500.0, -250.0])
def test_files_say_when_the_sound_begins(generation, offset_ms, toy_speech, tmp_path):
    delivery = Delivery(offset_ms=offset_ms)
    paths = [tmp_path / "a.json", tmp_path / "a.blender.py"]
    write(generation, paths, speech=toy_speech, delivery=delivery, curves="arkit", channels=["jawOpen"])
    assert json.loads(paths[0].read_text())["source"] == {"file": toy_speech.name, "start_s": f"{offset_ms / 1000:g}"}
    assert f"SOUND_S = {offset_ms / 1000!r}\n" in paths[1].read_text()
    scene = build_scene(performed(generation, "head", outputs=Outputs(rate_hz=12.0), delivery=delivery))
    assert scene.sound_s == pytest.approx(offset_ms / 1000)


def test_weights_beside_an_opening_are_enlarged_for_the_mesh_that_has_them(generation, tmp_path):
    write_glb(tmp_path / "head.glb", head())
    character = read_character(tmp_path / "head.glb")
    larger = Delivery(intensity=2)
    both = with_curves(generation, "arkit")[0]
    before, after = both.motion["jawOpen"], deliver_to_face(both, larger, 25.0, character).motion["jawOpen"]
    assert after.max() > 1.3 * before.max()
    plain, doubled = (deliver_to_face(generation, each, 25.0).motion["opening"] for each in (Delivery(), larger))
    assert doubled.max() > 1.5 * plain.max()


@pytest.mark.parametrize("offset_ms", [30.0, -30.0, 0.0])
def test_loudness_and_pitch_move_together(offset_ms):
    prosody = Prosody(np.arange(10.0) - 40, np.arange(10.0) / 10)
    moved, by = shift_prosody(prosody, Delivery(offset_ms=offset_ms)), round(offset_ms / 10)
    assert len(moved.level_db) == len(moved.log_f0) == 10 + by
    assert moved.level_db[max(by, 0) :] == pytest.approx(prosody.level_db[max(-by, 0) :])
    assert moved.log_f0[max(by, 0) :] == pytest.approx(prosody.log_f0[max(-by, 0) :])
    assert (moved.level_db[: max(by, 0)] == -40).all()  # quiet, and without a pitch
    assert np.isnan(moved.log_f0[: max(by, 0)]).all()


@pytest.mark.parametrize("rate_hz", [12.0, 23.976])
def test_closures_between_two_frames_of_a_slow_file_are_kept(generation, rate_hz, tmp_path):
    narrow, column = generation.motion.values.copy(), generation.motion.column("opening")
    closed = [each.frame for each in find_closures(generation.motion, generation.units)]
    narrow[50:100, column] = 0.1
    narrow[closed, column] = 0.0
    spiky = replace(generation, motion=replace(generation.motion, values=narrow))
    write(spiky, tmp_path / "a.csv", rate_hz=rate_hz, channels=["opening"])
    opening = read_motion(tmp_path / "a.csv")[0]["opening"]
    assert opening[[round(frame / 100 * rate_hz) for frame in closed]] == pytest.approx(0.0, abs=1e-6)


def test_eyes_head_and_moods_move_on_while_the_mouth_is_held(generation, tmp_path):
    smooth, delivery = with_curves(generation, "face")[0], Delivery(min_hold_ms=400)
    assert max(np.abs(smooth.motion[name]).max() for name in ("eyeBlinkLeft", "headYaw")) > 1e-3
    steps = hold_mouth_poses(smooth, delivery.hold_frames(100), [])
    for name in ("eyeBlinkLeft", "headYaw", "browInnerUp"):
        assert steps.motion[name] == pytest.approx(smooth.motion[name])
        assert name not in steps.stepped
    mouth = steps.motion["jawOpen"]
    changes = np.flatnonzero(np.abs(np.diff(mouth)) > 1e-9) + 1
    assert np.diff([0, *changes, len(mouth)]).min() >= 40
    write(smooth, tmp_path / "a.livelink.csv", delivery=delivery, rate_hz=100)
    assert read_motion(tmp_path / "a.livelink.csv")[0]["headYaw"] == pytest.approx(smooth.motion["headYaw"], abs=1e-5)
    assert {"jawOpen", "opening"} <= set(steps.stepped)
    stepped = deliver_to_face(generation, Delivery(mood="happy, sad at 1.0", stepped=True), 25.0)
    assert "mood_sad" not in stepped.stepped
    assert len(np.unique(stepped.motion["mood_sad"])) > 6


def test_moods_are_channels_that_the_intensity_leaves_and_the_offset_moves(generation):
    found = deliver(generation, Delivery(mood="happy:0.5, neutral at 1.0", intensity=2.0, offset_ms=500)).motion
    assert found.names == (*generation.motion.names, "mood_happy")
    assert found["mood_happy"][[0, 100, -1]] == pytest.approx([0.5, 0.5, 0.0])
    assert np.array_equal(deliver(replace(generation, motion=found), Delivery()).motion.values, found.values)


def test_words_say_the_mood_after_the_one_that_is_asked_for_and_neutral_is_none(generation):
    tagged = replace(generation, moods=(MoodKey(1.0, "sad"),))
    assert deliver(tagged, Delivery()).motion["mood_sad"][[0, -1]] == pytest.approx([0, 1])
    both = deliver(tagged, Delivery(mood="happy")).motion
    assert (both["mood_happy"][0], both["mood_sad"][-1]) == (1, 1)
    assert both["mood_happy"][-1] == pytest.approx(0)
    plain, neutral = (deliver(generation, Delivery(mood=mood)).motion for mood in ("", "neutral"))
    assert neutral.names == plain.names
    assert np.array_equal(neutral.values, plain.values)


def test_a_filmed_face_has_the_mood_of_its_footage(generation, caplog):
    person = ShownPerson(FilmedFace(None, None, ()))  # type: ignore[arg-type] # nothing of it is needed
    with pytest.raises(InputError, match="the mood of its footage"):
        person.check_video(Path("a.mp4"), OutputSettings(face=person, delivery=Delivery(mood="happy")))
    person.check_video(Path("a.mp4"), OutputSettings(face=person, delivery=Delivery(mood="whisper")))
    person.check_drawable(Path("a.mp4"), replace(generation, moods=(MoodKey(0, "shout"), MoodKey(1, "sad", 0.5))))
    assert caplog.messages == ["a.mp4: a filmed face has the mood of its footage; not shown: sad:0.5"]


def test_vowels_have_expressions_of_moods_that_leave_the_lips_closed(generation):
    afraid = deliver(generation, Delivery(mood="afraid"))
    curves = make_curves(afraid.motion, afraid.units, "vowels")
    assert {*curves.names} - {*make_curves(generation.motion, generation.units, "vowels").names} >= {"sad", "surprised"}
    assert (curves["sad"][0], curves["surprised"][0]) == pytest.approx((0.5, 0.5))
    pressed = curves["closed"] > 0
    assert pressed.any()
    assert curves["surprised"][pressed] == pytest.approx(0)


def test_a_face_laughs_where_laughter_is_detected_and_asked_for(toy_model):
    audio = recording((0.5, vowels(pulses(1.0, 120))), (2.0, laugh(6)))
    request = Request(audio, units=said(audio.duration_s, (0.5, 1.5)))
    laughing = animate(request, model=toy_model)
    (event,) = laughing.events
    assert event.kind == "laughter"
    opening = laughing.motion["opening"]
    loudest_s = max(event.calls, key=lambda call: call[1])[0]
    assert opening[round(loudest_s * 100)] == pytest.approx(LAUGH_GAP, rel=0.1)
    happy = deliver(laughing, Delivery()).motion["mood_happy"]
    assert happy[round(loudest_s * 100)] > 0.7
    assert not happy[:150].any()
    assert "mood_happy" not in deliver(laughing, Delivery(mood="neutral")).motion.names
    plain = animate(replace(request, manner="asked"), model=toy_model)
    assert not plain.events
    assert plain.motion["opening"][200:].max() < 0.05
    assert np.array_equal(plain.motion.values[50:150], laughing.motion.values[50:150])
