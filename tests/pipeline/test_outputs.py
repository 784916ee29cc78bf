from collections.abc import Callable
from dataclasses import replace

import pytest

from lipmotion import Outputs, cues, write, write_cues
from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import Registry
from lipmotion.pipeline.outputs import output
from lipmotion.pipeline.outputs.cues import CueOutput
from lipmotion.pipeline.outputs.motion_files import MotionOutput
from lipmotion.pipeline.outputs.output import (
    LabelOutput,
    Output,
    OutputSettings,
    Performance,
    SoundOutput,
    create_outputs,
    plan,
)
from lipmotion_faces.outputs.drawn_video import PicturesOutput, VideoOutput
from lipmotion_faces.outputs.scenes import SceneOutput
from lipmotion_faces.outputs.shown_faces import shown_face


class WordOutput(Output):
    """``.words.csv``: the phones, as an installed package may write them."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: ARG003
        return (".words.csv",)

    def prepare(self, performance: Performance) -> Callable[[], None]:
        phones = [span.label.phone for span in performance.generation.units]
        if not phones:
            raise ExportError(f"{self.path}: no phones")
        return lambda: self.path.write_text(" ".join(phones)) and None


@pytest.fixture
def settings() -> OutputSettings:
    return OutputSettings(shown_face("portrait"), sounded=True)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.json", MotionOutput), ("a.LIVELINK.csv", MotionOutput), ("a.cues.json", CueOutput),
        ("a.Cues.TSV", CueOutput), ("cues.json", MotionOutput), ("a.mp4", VideoOutput), ("a.MOV", VideoOutput),
        ("a%05d.png", PicturesOutput), ("a.glb", SceneOutput), ("a.textgrid", LabelOutput), ("a.flac", SoundOutput),
    ],
)  # fmt: skip
def test_a_name_asks_for_a_kind(name, kind, settings):
    assert type(plan(name, settings)) is kind


def test_what_no_kind_writes_is_refused(settings, tmp_path):
    for name in ("a.xyz", "a.png", "a"):
        with pytest.raises(ExportError, match="required one of") as error:
            plan(name, settings)
        assert {".json", ".mp4", ".glb", ".wav", "%05d.png", ".cues.tsv"} <= {*str(error.value).split()}
    with pytest.raises(ExportError, match=r"unknown format '\.wav'"):
        plan("a.wav", replace(settings, sounded=False))
    with pytest.raises(InputError, match="the frame rate is 101"):
        create_outputs([tmp_path / "a.cues.tsv"], replace(settings, outputs=Outputs(fps=101.0)))


def test_cues_beside_other_outputs_are_those_of_the_function(result, tmp_path):
    write(result, [tmp_path / "a.cues.tsv", tmp_path / "a.csv"])
    write_cues(cues(result), tmp_path / "b.tsv")
    assert (tmp_path / "a.cues.tsv").read_bytes() == (tmp_path / "b.tsv").read_bytes()


def test_a_kind_of_a_package_is_written_beside_others(result, tmp_path, monkeypatch):
    kinds = {**output.OUTPUTS.built_in, "words": f"{__name__}:WordOutput", "wrong": f"{__name__}:settings"}
    monkeypatch.setattr(output, "OUTPUTS", Registry("output", "lipmotion.outputs", kinds))
    with pytest.raises(InputError, match="is called an output, 'wrong', by an installed package"):
        write(result, tmp_path / "a.words.csv")
    del kinds["wrong"]
    write(result, [tmp_path / "a.words.csv", tmp_path / "a.json"])
    assert (tmp_path / "a.words.csv").read_text().split() == [span.label.phone for span in result.units]
    silent = replace(result, units=type(result.units)(()))
    with pytest.raises(ExportError, match="no phones"):
        write(silent, [tmp_path / "b.json", tmp_path / "b.words.csv"])
    assert not (tmp_path / "b.json").exists()


def test_outputs_share_what_is_made_once(result, settings):
    performance, made = Performance(result, settings), []

    def make(_: Performance) -> list[int]:
        made.append(1)
        return made

    assert performance.cached(make) is performance.cached(make)
    assert made == [1]
