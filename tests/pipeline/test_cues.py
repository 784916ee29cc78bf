from dataclasses import replace

import numpy as np
import pytest

import lipmotion
from lipmotion.articulation.cue_sheets import list_frame_shapes
from lipmotion.errors import ExportError
from lipmotion.formats.cues import CUE_FORMATS
from lipmotion.pipeline.outputs.cues import cue_text
from lipmotion.types import Audio, Timeline
from testing.toy import toy_sentences


def test_several_files_at_once(result, tmp_path):
    sheet = lipmotion.cues(result)
    paths = [tmp_path / f"é.{form}" for form in CUE_FORMATS]
    lipmotion.write_cues(sheet, paths, speech="é.wav")
    for path, form in zip(paths, CUE_FORMATS, strict=True):
        assert path.read_text() == cue_text(sheet, speech="é.wav", form=form)


def test_results_that_have_no_cues(result):
    with pytest.raises(ExportError, match="has no phones"):
        lipmotion.cues(replace(result, units=Timeline(())))
    broken = result.motion.values.copy()
    broken[3, 0] = np.nan
    with pytest.raises(ExportError, match="not finite"):
        lipmotion.cues(replace(result, motion=replace(result.motion, values=broken)))


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
        opening[frames.start - 60 : frames.stop + 60] = outside = opening[100]
    assert opening == pytest.approx(outside)
