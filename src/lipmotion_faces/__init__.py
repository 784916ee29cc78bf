"""Faces: from motion to pictures."""

from lipmotion_faces.base import Face, Stageable, Staging
from lipmotion_faces.registry import FACES, face_named, staged_face

__all__ = ["FACES", "Face", "Stageable", "Staging", "face_named", "staged_face"]
