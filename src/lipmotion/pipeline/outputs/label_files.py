"""Files of phones and words in time, as outputs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from lipmotion.articulation.delivery import sound_units
from lipmotion.export.timed_labels import LABEL_SUFFIXES, write_labels
from lipmotion.pipeline.outputs.output import Output, OutputSettings, Performance


class LabelOutput(Output):
    """``.TextGrid``, ``.vtt``, ``.srt``: phones and words, in the time of the sound."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102, ARG003
        return LABEL_SUFFIXES

    def prepared(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        generation = performance.generation
        end_s = float(generation.motion.time_s[-1])
        return partial(write_labels, self.path, sound_units(generation.units, self.settings.delivery, end_s))
