"""Faces: from motion to pictures."""

from lipmotion.faces.base import Face, Stageable, Staging
from lipmotion.faces.registry import FACES, face_named, staged_face

__all__ = ["FACES", "Face", "Stageable", "Staging", "face_named", "staged_face"]
