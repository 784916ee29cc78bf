"""Faces: from motion to pictures."""

from lipmotion.faces.base import Face
from lipmotion.faces.registry import FACES, face_named

__all__ = ["FACES", "Face", "face_named"]
