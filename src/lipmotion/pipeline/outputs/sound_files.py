"""Files of the sound, as outputs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from lipmotion.errors import ExportError
from lipmotion.export.sound import SOUND_CODECS, write_sound
from lipmotion.pipeline.outputs.output import Output, OutputSettings, Performance


class SoundOutput(Output):
    """``.wav``, ``.flac``, ``.ogg``: a sound that is in no file yet."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102
        return tuple(SOUND_CODECS) if settings.sounded else ()

    def prepared(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        if performance.sound is None:
            raise ExportError(f"{self.path}: there is no sound to write; give one: write(..., speech=Audio(...))")
        return partial(write_sound, self.path, performance.sound)
