"""Single pictures of a session's motion, for programs that show edits at once."""

from __future__ import annotations

from functools import cached_property
from threading import RLock
from typing import Any

from lipmotion.errors import InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.edits import Edits
from lipmotion.pipeline.outputs.output import measure_prosody, shift_prosody
from lipmotion.pipeline.session import Cache, Session
from lipmotion.types import Prosody, frame_of
from lipmotion_faces.base import DrawnMotion, DrawsSingly, Face, Picture
from lipmotion_faces.outputs.drawn_video import DRAWN_HZ, deliver_to_face, read_sound
from lipmotion_faces.registry import stage_face


class SessionPictures:
    """Pictures of drawn faces with the motion of a session; what of a face does not move is painted once.

    >>> import lipmotion
    >>> pictures = lipmotion.SessionPictures(lipmotion.Session("examples/welcome.flac"))
    >>> pictures.draw(1.2, lipmotion.Edits().then("set size 64")).shape
    (64, 64, 3)
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._one_at_a_time = RLock()
        self._cache = Cache()

    def draw(
        self, time_s: float, edits: Edits | None = None, *, face: str | Face = "portrait", fps: float = DRAWN_HZ
    ) -> Picture:
        """Return the picture of a drawn face that is shown at a time in a video [shape as of ``Face.render``].

        edits : of the motion, its delivery and its staging; None: there are none
        fps   : frames a second of the video
        Raises InputError: as ``Session.generate``; a time outside the recording; a face that draws no single pictures.
        """
        edits = edits or Edits()
        staging, delivery = edits.staging(), edits.delivery()

        def make_drawing() -> DrawsSingly:
            drawing = stage_face(face, staging, shift_prosody(self._prosody, delivery))
            if not isinstance(drawing, DrawsSingly):
                raise InputError(f"the face {face!r} draws no single pictures; write a video")
            return drawing

        def draw() -> DrawnMotion[Any]:
            generation = self._session.generate(edits)
            prosody = shift_prosody(self._prosody, delivery) if generation.curve_edits else None
            seen = deliver_to_face(generation, delivery, fps, None, staging, prosody)
            return self._cache.cached("face", (face, staging, delivery), make_drawing).draw(
                seen.motion, seen.units, fps=fps
            )

        with self._one_at_a_time, limit_threads():
            pictures = self._cache.cached("drawn", (edits.steps, face, fps, self._session.is_sketching), draw)
            frame = frame_of(time_s, len(pictures), fps)
            if frame is None:
                raise InputError(f"{time_s} s lies outside the video (0 to {(len(pictures) - 1) / fps:.2f} s)")
            return pictures.draw(frame)

    @cached_property
    def _prosody(self) -> Prosody:
        return measure_prosody(read_sound(self._session.request.recording))
