"""Following one person through a video, across cuts and among other faces."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.tracking import trackers
from lipmotion_faces.tracking.image_similarity import correlate_images, is_cut, reduce_face, reduce_scene
from lipmotion_faces.tracking.packages import import_opencv

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

REACH = 2.5
"""Side of a window, in sides of the face in it: the mesh's detector finds faces of a third of a picture best."""
SIZE_PX = 384  # every window is scaled to this side: the mesh then always sees faces of about one size
STEADY_RATIO = 1.25  # the window keeps its side until that of the face has changed by this ratio


@dataclass(frozen=True)
class FaceWindow:
    """A square part of a picture, possibly beyond its edges: upper left corner and side, px."""

    left: int
    top: int
    side: int

    @staticmethod
    def place(x: float, y: float, side: float) -> FaceWindow:
        """Return the window whose middle is nearest to a point; of a side given, px."""
        pixels = max(1, round(side))
        return FaceWindow(round(x - pixels / 2), round(y - pixels / 2), pixels)

    def cut(self, image: Image) -> Image:
        """Return this part of a picture, scaled to ``SIZE_PX``; beyond the picture it is black."""
        cv2 = import_opencv()
        height, width = image.shape[:2]
        right, bottom = self.left + self.side, self.top + self.side
        part = image[max(self.top, 0) : max(bottom, 0), max(self.left, 0) : max(right, 0)]
        beyond = max(-self.top, 0), max(bottom - height, 0), max(-self.left, 0), max(right - width, 0)
        if not part.size:
            return np.zeros((SIZE_PX, SIZE_PX, 3), np.uint8)
        if any(beyond):
            part = cv2.copyMakeBorder(part, *beyond, cv2.BORDER_CONSTANT)
        way = cv2.INTER_AREA if self.side > SIZE_PX else cv2.INTER_CUBIC
        return cv2.resize(part, (SIZE_PX, SIZE_PX), interpolation=way)

    def to_picture(self, points: Array) -> Array:
        """Return points of the scaled window [shape=(..., 3)] as points of the picture, px."""
        return points * (self.side / SIZE_PX) + (self.left, self.top, 0)


class WindowedMesh:
    """Follows one face with the mesh of a tracker in a window that goes along with it."""

    def __init__(self, box: trackers.FaceBox, tracker: trackers.LandmarkTracker) -> None:
        self._window = FaceWindow.place(box.x, box.y, REACH * box.side)
        self._mesh = tracker.open_point_finder()

    def __enter__(self) -> WindowedMesh:
        return self

    def __exit__(self, *_: object) -> None:
        self._mesh.__exit__(None, None, None)

    def find_faces(self, image: Image) -> list[Array]:
        """Return the points of the face in the next picture, as ``PointFinder.find_faces``; none or one."""
        faces = [self._window.to_picture(face) for face in self._mesh.find_faces(self._window.cut(image))]
        if faces:
            low, high = faces[0][:, :2].min(axis=0), faces[0][:, :2].max(axis=0)
            side = REACH * float((high - low).max())
            is_steady = 1 / STEADY_RATIO < side / self._window.side < STEADY_RATIO
            x, y = (low + high) / 2
            self._window = FaceWindow.place(float(x), float(y), self._window.side if is_steady else side)
        return faces


MAX_FACES = 4  # the most faces that are searched for where a scene begins
JUMP, GROWTH = 0.6, 1.25
"""Most eye distances that a face moves in a frame (GRID: up to 0.03), and the largest ratio of its sizes (1.06)."""
LOST_FRAMES = 10  # a face that was missing in more frames must be recognised again
SAME_PERSON_CORRELATION = 0.9
"""Correlation of the upper faces above which two faces are one person's. GRID: 0.90 to 1 within a clip; two people, 0.2
to 0.87 in 14 pairs of 15, and 0.94 in one."""
LARGE_PX = 1280
"""In a picture with a longer side than this, faces are first searched with the full-range detector, as they are likely
to be small in it, and followed in a window, which takes less time than the mesh of the whole picture."""
THOROUGH_STEP = 5  # where no face is found, the parts of every such frame are searched too, not only the whole picture
THUMBNAIL_STEP, MAX_THUMBNAILS = 5, 20
"""Every how many frames of a scene a thumbnail of the face is kept for comparison, and how many at first."""
NEW_LOOK_CORRELATION, MAX_LOOKS = 0.95, 60
"""Later thumbnails are kept when they correlate less than this with all that are kept, and how many at most in all."""

_EYES = [trackers.TRACKED_POINTS.index(index) for index in trackers.EYE_CORNERS]


class FaceFollower:
    """Finds one face in every scene of a clip, frame by frame, and then selects the scenes of one person.

    The mesh finds a face that takes a fifth of the picture or more; smaller ones are found by the full-range detector
    and followed in a window.
    person  : thumbnails of the person who is to be followed; without any, it is the one with the most frames
    Raises InputError: no tracker of that name.
    """

    def __init__(self, person: Sequence[Array] = (), tracker: str = trackers.MEDIAPIPE) -> None:
        self._wanted = list(person)
        self._tracker = trackers.make_tracker(tracker)
        self._finder = self._tracker.open_box_finder()
        self._scenes = [_Scene(self._wanted, self._finder, self._tracker)]
        self._picture: Array | None = None
        self._scene_of_frame: list[int | None] = []  # None: no face was found

    def __enter__(self) -> FaceFollower:
        return self

    def __exit__(self, *_: object) -> None:
        self._scenes[-1].close()
        self._finder.__exit__(None, None, None)

    def follow(self, image: Image) -> Array | None:
        """Return the points of a face in the next frame, as of ``PointFinder.find_faces``; None if there is none.

        Of several faces it is the one followed so far; where a scene begins, one that was followed before, else the
        largest and most central.
        """
        before, self._picture = self._picture, reduce_scene(image)
        if is_cut(before, self._picture) or self._scenes[-1].missing_frames > LOST_FRAMES:
            self._begin_scene()
        face = self._scenes[-1].follow(image)
        if face is None and self._scenes[-1].is_lost:
            self._begin_scene()
            face = self._scenes[-1].follow(image)
        self._scene_of_frame.append(None if face is None else len(self._scenes) - 1)
        return face

    def is_upside_down(self, image: Image, face: Array) -> bool:
        """Return whether the detector is surer of a face in the picture turned by half: the mesh finds one in both."""
        x, y = face[_EYES[1], :2] - face[_EYES[0], :2]
        views = (image, np.ascontiguousarray(image[::-1, ::-1])) if x > abs(y) else ()  # a leaning face is followed
        scores = [max((box.score for box in self._finder.find_boxes(v, thorough=False)), default=0.0) for v in views]
        return bool(scores and scores[1] > scores[0])

    def mark_person(self) -> NDArray[np.bool_]:
        """Return in which frames the face found is that of the person [shape=(T,)]."""
        scenes = self._find_scenes()
        return np.array([scene in scenes for scene in self._scene_of_frame])

    def measure_share(self) -> float:
        """Return in which share of the frames with a face it is that of the person; 1 if there is no face."""
        with_face = sum(scene is not None for scene in self._scene_of_frame)
        return float(self.mark_person().sum()) / with_face if with_face else 1.0

    def list_thumbnails(self) -> list[Array]:
        """Return thumbnails of the person's face, at most ``MAX_LOOKS`` from all scenes."""
        scenes = sorted(self._find_scenes())
        looks = [thumbnail for index in scenes for thumbnail in self._scenes[index].thumbnails]
        return looks[:: -(-len(looks) // MAX_LOOKS)] if looks else []

    def list_cuts(self) -> list[int]:
        """Return the frames at which the camera changes, or the picture changes to or from somebody else."""
        of_person, cuts, last = self._find_scenes(), [], None
        for index, scene in enumerate(self._scenes):
            if scene.thumbnails:
                is_same = last is None or (index in of_person) == (last in of_person)
                if not is_same or (last is not None and not scene.is_near(self._scenes[last])):
                    cuts.append(self._scene_of_frame.index(index))
                last = index
        return cuts

    def _begin_scene(self) -> None:
        self._scenes[-1].close()
        known = self._wanted or [thumbnail for scene in self._scenes for thumbnail in scene.thumbnails]
        self._scenes.append(_Scene(known, self._finder, self._tracker))

    def _find_scenes(self) -> set[int]:
        """Return the scenes of the wanted person, else the longest one, and all whose face resembles one of theirs."""
        counts = np.bincount([n for n in self._scene_of_frame if n is not None], minlength=len(self._scenes))
        of_person = set() if self._wanted else {int(np.argmax(counts))}
        while True:
            known = self._wanted + [thumbnail for index in of_person for thumbnail in self._scenes[index].thumbnails]
            more = {
                index
                for index, scene in enumerate(self._scenes)
                if _find_best_correlation(scene.thumbnails, known) > SAME_PERSON_CORRELATION
            } - of_person
            if not more:
                return of_person
            of_person |= more


class _Scene:
    """The frames between two cuts, and the face followed through them.

    thumbnails     : of the face, every ``THUMBNAIL_STEP`` frames, later only where it looks different
    missing_frames : frames since the face was last found, 0 before it was found
    is_lost        : whether the mesh, which follows one face, has changed to another one
    """

    def __init__(self, known: Sequence[Array], finder: trackers.BoxFinder, tracker: trackers.LandmarkTracker) -> None:
        self.thumbnails: list[Array] = []
        self.missing_frames = 0
        self.is_lost = False
        self._known = known
        self._finder, self._tracker = finder, tracker
        self._searches = 0
        self._first: Array | None = None
        self._last: Array | None = None
        self._frames = 0
        self._open = ExitStack()
        self._mesh: trackers.PointFinder | WindowedMesh | None = None
        self._is_crowd = False

    def close(self) -> None:
        self._open.close()

    def follow(self, image: Image) -> Array | None:
        """Return the points of the followed face in the next frame, None where it is not found."""
        if self._last is None:
            face = self._first = self._choose_face(image)
        elif faces := self._find_faces(image):
            last = self._last
            near = [face for face in faces if self._can_be(face, last)]
            self.is_lost = not near and not self._is_crowd
            face = min(near, key=lambda face: _measure_distance(face, last), default=None)
        else:
            face = self._search(image, self._last)
        if face is None:
            self.missing_frames += self._last is not None
            return None
        if self._frames % THUMBNAIL_STEP == 0 and len(self.thumbnails) < MAX_LOOKS:
            look = reduce_face(image, face[_EYES, :2])
            is_early = len(self.thumbnails) < MAX_THUMBNAILS
            if is_early or _find_best_correlation([look], self.thumbnails) < NEW_LOOK_CORRELATION:
                self.thumbnails.append(look)
        self._frames += 1
        self._last, self.missing_frames = face, 0
        return face

    def is_near(self, before: _Scene) -> bool:
        """Return whether this scene's face begins where the one before ended."""
        return self._first is not None and before._last is not None and before._can_be(self._first, before._last)

    def _choose_face(self, image: Image) -> Array | None:
        """Return the face to follow; of several ones all are followed from now on, which takes twice the time."""
        is_large = max(image.shape[:2]) > LARGE_PX
        face = self._search(image) if is_large else None
        if face is not None:
            return face
        faces = self._find_faces(image)
        if not faces:
            return None if is_large else self._search(image)
        crowd = self._open.enter_context(self._tracker.open_point_finder(MAX_FACES))
        several = crowd.find_faces(image)
        if len(several) >= 2:
            self._mesh, self._is_crowd, faces = crowd, True, several
        return max(faces, key=lambda face: self._rank_face(image, face))

    def _search(self, image: Image, last: Array | None = None) -> Array | None:
        """Return the face that the detector finds, ``last`` if given, and follow it in a window from now on."""
        boxes = self._finder.find_boxes(image, thorough=self._searches % THOROUGH_STEP == 0)
        self._searches += 1
        faces: list[tuple[Array, WindowedMesh]] = []
        with ExitStack() as tried:
            for box in boxes[:MAX_FACES]:
                mesh = tried.enter_context(WindowedMesh(box, self._tracker))
                faces += [(face, mesh) for face in mesh.find_faces(image) if last is None or self._can_be(face, last)]
            if not faces:
                return None
            face, self._mesh = max(faces, key=lambda pair: self._rank_face(image, pair[0]))
            self._open.push(tried.pop_all())
        self._is_crowd = False
        return face

    def _can_be(self, face: Array, last: Array) -> bool:
        growth = _measure_size(face) / _measure_size(last)
        return _measure_distance(face, last) < JUMP * (1 + self.missing_frames) and 1 / GROWTH < growth < GROWTH

    def _find_faces(self, image: Image) -> list[Array]:
        if self._mesh is None:
            self._mesh = self._open.enter_context(self._tracker.open_point_finder())
        return self._mesh.find_faces(image)

    def _rank_face(self, image: Image, face: Array) -> tuple[bool, float]:
        """Return whether a face was followed before, and its size, which counts half at the edge of the picture."""
        is_known = _find_best_correlation([reduce_face(image, face[_EYES, :2])], self._known) > SAME_PERSON_CORRELATION
        return is_known, _measure_size(face) * (1 - abs(float(_find_middle(face)[0]) / image.shape[1] - 0.5))


def _find_best_correlation(thumbnails: Sequence[Array], others: Sequence[Array]) -> float:
    """Return the highest correlation of a thumbnail with one of the others, 0 where there is none."""
    if not thumbnails or not others:
        return 0.0
    return float(correlate_images(np.stack(thumbnails)[:, None], np.stack(others)).max())


def _measure_distance(face: Array, other: Array) -> float:
    """Return the distance between the middles of two faces, in eye distances of the second."""
    return float(np.linalg.norm(_find_middle(face) - _find_middle(other))) / _measure_size(other)


def _find_middle(face: Array) -> Array:
    """Return the point between the outer eye corners, px [shape=(2,)]."""
    return face[_EYES, :2].mean(axis=0)


def _measure_size(face: Array) -> float:
    """Return the distance between the outer eye corners, px."""
    return float(np.linalg.norm(face[_EYES[1], :2] - face[_EYES[0], :2]))
