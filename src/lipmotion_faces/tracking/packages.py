"""The optional packages of face tracking, imported when they are first needed."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Any

from lipmotion.errors import MissingDependencyError
from lipmotion.extensions import install_command


def import_opencv() -> Any:
    """Return the module ``cv2``. Raises MissingDependencyError: it cannot be imported."""
    try:
        import cv2
    except ImportError as error:
        raise explain_missing("OpenCV", error) from error
    return cv2


def tracking_versions() -> str:
    """Return the version of OpenCV; MediaPipe is imported, too. Raises MissingDependencyError: one cannot be."""
    import_solution("face_mesh")
    return import_opencv().__version__


def import_solution(name: str) -> Any:
    """Return a module of MediaPipe's solutions, with less logging. Raises MissingDependencyError: no import."""
    os.environ.setdefault("GLOG_minloglevel", "2")
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    try:
        solutions = import_module("mediapipe.python.solutions")  # all of them
    except ImportError as error:
        raise explain_missing("MediaPipe", error) from error
    return getattr(solutions, name)


def explain_missing(package: str, error: ImportError) -> MissingDependencyError:
    """Return the error that a package cannot be imported, which says how to install it."""
    return MissingDependencyError(
        f"face tracking needs {package}, which cannot be imported ({error}); "
        f"{install_command('video')} with Python 3.10 to 3.12 (MediaPipe needs Python < 3.13)"
    )
