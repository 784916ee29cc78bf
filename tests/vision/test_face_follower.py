from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion_faces.tracking import face_follower, mediapipe, trackers
from lipmotion_faces.tracking import face_follower as follow
from vision.scripted import Opened, StandIn

HEIGHT, WIDTH = 240, 320
EYES = [trackers.TRACKED_POINTS.index(index) for index in trackers.EYE_CORNERS]
Face = tuple[str, float, float, float]  # who, x and y between the eyes, distance between them


def picture(faces: Sequence[Face], place: int = 0) -> NDArray[np.uint8]:
    """Return a place with people in it, each with a look of his or her own."""
    image = np.kron(np.random.default_rng(place).uniform(0, 80, (6, 8, 3)), np.ones((40, 40, 1)))
    for who, x, y, unit in faces:
        look = np.random.default_rng(ord(who.lower())).uniform(90, 255, (8, 12, 3))
        size = round(1.5 * unit / 12)
        drawn = np.kron(look, np.ones((size, size, 1)))
        top, left = round(y - 0.5 * unit), round(x - 0.75 * unit)
        part = image[top : top + drawn.shape[0], left : left + drawn.shape[1]]
        part[:] = drawn[: part.shape[0], : part.shape[1]]
    return image.astype(np.uint8)


def points(face: Face) -> NDArray[np.float64]:
    _, x, y, unit = face
    found = np.full((len(trackers.TRACKED_POINTS), 3), (x, y, 0.0))
    found[EYES] = [(x - unit / 2, y, 0), (x + unit / 2, y, 0)]
    return found


SMALL_FACE_PX = 40  # a face with a smaller distance between the eyes is found by the detector alone


class Mesh(Opened):
    """Finds the faces of the frame that is being shown, at most so many, in their order; not those in capitals."""

    shown: Sequence[Face] = ()

    def __init__(self, most: int = 1) -> None:
        self.most = most

    def find_faces(self, image: NDArray[np.uint8]) -> list[NDArray[np.float64]]:  # noqa: ARG002
        return [points(face) for face in Mesh.shown if face[0].islower() and face[3] >= SMALL_FACE_PX][: self.most]


class Finder(Opened):
    """Stands for the detector: finds all faces of the frame that is being shown, those in capitals too."""

    def find_boxes(self, image: NDArray[np.uint8], *, thorough: bool = True) -> list[trackers.FaceBox]:  # noqa: ARG002
        return [trackers.FaceBox(x, y, 2 * unit, 0.9) for _, x, y, unit in Mesh.shown]


class Shown(StandIn):
    """Finds the faces of the frame that is being shown."""

    mesh, finder = Mesh, Finder


class SmallMesh:
    """Stands for the mesh in a window: finds the face that is nearest to the last one; not those in capitals."""

    open = 0

    def __init__(self, box: trackers.FaceBox, _: trackers.LandmarkTracker) -> None:
        self.x = box.x

    def __enter__(self) -> "SmallMesh":
        SmallMesh.open += 1
        return self

    def __exit__(self, *_: object) -> None:
        SmallMesh.open -= 1

    def find_faces(self, _image: NDArray[np.uint8]) -> list[NDArray[np.float64]]:
        near = [face for face in Mesh.shown if face[0].islower() and abs(face[1] - self.x) < 2 * face[3]]
        if near:
            self.x = near[0][1]
        return [points(face) for face in near[:1]]


Show = Callable[..., tuple[face_follower.FaceFollower, list[float | None]]]


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch) -> Show:
    """Shows frames (faces, place); returns the follower, and where the face was followed to."""
    pytest.importorskip("cv2")
    monkeypatch.setitem(trackers.TRACKERS.built_in, "mediapipe", f"{__name__}:Shown")
    monkeypatch.setattr(follow, "WindowedMesh", SmallMesh)

    def run(
        frames: Sequence[tuple[Sequence[Face], int]], person: Sequence[NDArray[np.float64]] = ()
    ) -> tuple[face_follower.FaceFollower, list[float | None]]:
        followed: list[float | None] = []
        with face_follower.FaceFollower(person) as follower:
            for faces, place in frames:
                Mesh.shown = faces
                found = follower.follow(picture(faces, place))
                followed.append(None if found is None else float(found[EYES, 0].mean()))
        return follower, followed

    return run


ANNA, BELLA = ("a", 150.0, 100.0, 64.0), ("b", 150.0, 100.0, 64.0)


def moved(face: Face, by: float) -> Face:
    return (face[0], face[1] + by, *face[2:])


def test_a_moving_face_is_one_scene_and_the_one_shown_longest_is_the_person(show: Show) -> None:
    follower, followed = show([([moved(ANNA, n)], 0) for n in range(30)])
    assert followed == [150.0 + n for n in range(30)]
    assert follower.mark_person().all()
    assert follower.list_cuts() == []
    follower, _ = show([([ANNA], 0)] * 110)
    assert len(follower.list_thumbnails()) == face_follower.MAX_THUMBNAILS  # later looks are kept when they are new
    follower, _ = show([([BELLA], 1)] * 8 + [([ANNA], 0)] * 20 + [([BELLA], 1)] * 5)
    assert follower.mark_person().tolist() == [False] * 8 + [True] * 20 + [False] * 5
    assert follower.list_cuts() == [8, 28]


def test_she_is_known_again_elsewhere_and_a_face_that_jumps_is_looked_at_again(show: Show) -> None:
    """Without a cut in the picture, the mesh goes over to somebody else."""
    near = ("a", 120.0, 110.0, 96.0)
    follower, _ = show([([ANNA], 0)] * 10 + [([near], 2)] * 6 + [([BELLA], 1)] * 5 + [([ANNA], 0)] * 4)
    assert follower.mark_person().tolist() == [True] * 16 + [False] * 5 + [True] * 4
    assert follower.list_cuts() == [10, 16, 21]
    there = moved(BELLA, 1.5 * face_follower.JUMP * 64)
    follower, _ = show([([ANNA], 0)] * 12 + [([there], 0)] * 4 + [([ANNA], 0)] * 4)
    assert follower.mark_person().tolist() == [True] * 12 + [False] * 4 + [True] * 4


def test_a_face_that_is_surer_the_other_way_up_is_upside_down(show: Show) -> None:
    follower, _ = show([([ANNA], 0)])
    face = np.zeros((len(trackers.TRACKED_POINTS), 3))
    follower._finder = SimpleNamespace(  # type: ignore[assignment]
        find_boxes=lambda image, **_: [trackers.FaceBox(0, 0, 9, 0.5 + image[0, 0, 0] / 512)]
    )
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[-1, -1] = 255
    for x, y, expected in ((60, 0, True), (20, 60, False)):
        face[face_follower._EYES[1], :2] = x, y
        assert follower.is_upside_down(picture, face) is expected
        assert not follower.is_upside_down(picture[::-1, ::-1], face)


SMALL_ANNA, SMALL_BELLA = ("a", 220.0, 60.0, 32.0), ("b", 80.0, 60.0, 32.0)


def test_a_small_face_is_found_from_the_first_frame_and_followed(show: Show) -> None:
    follower, followed = show([([moved(SMALL_ANNA, n)], 0) for n in range(20)])
    assert followed == [220.0 + n for n in range(20)]
    assert follower.mark_person().all()
    assert follower.list_cuts() == []
    assert SmallMesh.open == 0


def test_a_small_face_that_is_lost_is_searched_where_it_was(show: Show) -> None:
    hidden = ("A", *SMALL_ANNA[1:])
    frames = [([SMALL_ANNA], 0)] * 8 + [([hidden], 0)] * 3 + [([SMALL_BELLA, moved(SMALL_ANNA, 10)], 0)] * 8
    follower, followed = show(frames)
    assert followed == [220.0] * 8 + [None] * 3 + [230.0] * 8
    assert np.flatnonzero(~follower.mark_person()).tolist() == [8, 9, 10]
    assert SmallMesh.open == 0
    assert show([([hidden], 0)] * 6)[1] == [None] * 6  # of which the mesh is unsure is nobody's
    assert SmallMesh.open == 0


def test_only_the_person_who_is_wanted_counts(show: Show) -> None:
    wanted = show([([ANNA], 0)] * 8)[0].list_thumbnails()
    follower, _ = show([([BELLA], 1)] * 20 + [([ANNA], 0)] * 5, wanted)
    assert follower.mark_person().tolist() == [False] * 20 + [True] * 5
    assert follower.measure_share() == pytest.approx(0.2)
    assert not show([([BELLA], 1)] * 20, wanted)[0].mark_person().any()


def test_of_several_the_largest_then_the_middle_one(show: Show) -> None:
    small, large = ("b", 80.0, 100.0, 40.0), ("a", 240.0, 100.0, 64.0)
    assert set(show([([small, large], 0)] * 5)[1]) == {240.0}
    middle, edge = ("a", 160.0, 100.0, 48.0), ("b", 40.0, 100.0, 48.0)
    assert set(show([([edge, middle], 0)] * 5)[1]) == {160.0}


def test_of_several_the_same_throughout_in_any_order(show: Show) -> None:
    one, other = ("a", 80.0, 100.0, 48.0), ("b", 230.0, 100.0, 64.0)
    frames = [([one, other] if n % 2 else [other, one], 0) for n in range(12)]
    frames[7] = ([one, ("B", *other[1:])], 0)
    follower, followed = show(frames)
    assert set(followed) == {230.0, None}
    assert np.flatnonzero(~follower.mark_person()).tolist() == [7]


def test_after_a_cut_to_several_the_known_one_is_taken(show: Show) -> None:
    wide = [("b", 90.0, 100.0, 64.0), ("a", 240.0, 100.0, 48.0)]
    follower, followed = show([([ANNA], 0)] * 8 + [(wide, 3)] * 8)
    assert followed[8:] == [240.0] * 8
    assert follower.mark_person().all()
    assert follower.list_cuts() == [8]


def test_away_for_long_is_compared_again(show: Show) -> None:
    gone = [([], 0)] * (face_follower.LOST_FRAMES + 2)
    for after, is_known in ((BELLA, False), (ANNA, True)):
        follower, followed = show([([ANNA], 0)] * 8 + gone + [([moved(after, 15)], 0)] * 4)
        assert [x is None for x in followed] == [False] * 8 + [True] * len(gone) + [False] * 4
        assert follower.mark_person().tolist() == [True] * 8 + [False] * len(gone) + [is_known] * 4


pytest.importorskip("cv2")


def bright(height: int, width: int, left: int, top: int, side: int) -> NDArray[np.uint8]:
    """Return a picture with a bright square."""
    image = np.zeros((height, width, 3), np.uint8)
    image[top : top + side, left : left + side] = 255
    return image


def test_positions_in_the_window_are_those_in_the_picture():
    for side in (96, 384, 800):
        window = face_follower.FaceWindow.place(500, 300, side)
        shown = window.cut(bright(720, 1280, 480, 310, 8))
        assert shown.shape == (face_follower.SIZE_PX, face_follower.SIZE_PX, 3)
        rows, columns = np.nonzero(shown[..., 0] > 127)
        middle = np.array([columns.mean() + 0.5, rows.mean() + 0.5, 0.0])  # 0 is the edge of the picture
        np.testing.assert_allclose(window.to_picture(middle), [484, 314, 0], atol=0.6)
    scaled = face_follower.FaceWindow(10, 20, 2 * face_follower.SIZE_PX).to_picture(np.array([[3.0, 4.0, 5.0]]))
    np.testing.assert_allclose(scaled, [[16.0, 28.0, 10.0]])  # depth is scaled, too


class BrightMesh:
    """Stands for the face mesh: a face is the box around what is bright."""

    closed = 0

    def __exit__(self, *_: object) -> None:
        BrightMesh.closed += 1

    def find_faces(self, image: NDArray[np.uint8]) -> list[NDArray[np.float64]]:
        rows, columns = np.nonzero(image[..., 0] > 127)
        if not rows.size:
            return []
        return [np.array([[columns.min(), rows.min(), 0.0], [columns.max() + 1.0, rows.max() + 1.0, 0.0]])]


def test_the_window_goes_along_and_grows_with_the_face():
    tracker = cast(trackers.LandmarkTracker, SimpleNamespace(open_point_finder=BrightMesh))
    with face_follower.WindowedMesh(trackers.FaceBox(230, 330, 60, 0.9), tracker) as mesh:
        for n in range(40):  # it moves much further than a window's side, and becomes twice as large
            x, side = 200 + 20 * n, 60 + 2 * n
            (found,) = mesh.find_faces(bright(720, 1280, x, 300, side))
            np.testing.assert_allclose(found[:, :2], [[x, 300], [x + side, 300 + side]], atol=2)
        assert mesh._window.side == pytest.approx(face_follower.REACH * side, rel=0.3)
        assert mesh.find_faces(np.zeros((720, 1280, 3), np.uint8)) == []
        assert len(mesh.find_faces(bright(720, 1280, x, 300, side))) == 1
    assert BrightMesh.closed == 1


class Detector:
    """Stands for MediaPipe's: finds a bright square if it takes a fiftieth of the picture's longer side."""

    def __init__(self) -> None:
        self.shapes: list[tuple[int, ...]] = []

    def process(self, image: NDArray[np.uint8]) -> SimpleNamespace:
        self.shapes.append(image.shape[:2])
        rows, columns = np.nonzero(image[..., 0] > 200)
        if not rows.size or np.ptp(columns) + 1 < max(image.shape) / 50:
            return SimpleNamespace(detections=None)
        height, width = image.shape[:2]
        sides = {"width": (np.ptp(columns) + 1) / width, "height": (np.ptp(rows) + 1) / height}
        box = SimpleNamespace(xmin=columns.min() / width, ymin=rows.min() / height, **sides)
        data = SimpleNamespace(relative_bounding_box=box)
        return SimpleNamespace(detections=[SimpleNamespace(location_data=data, score=[0.8])])

    def close(self) -> None:
        pass


@pytest.fixture
def finder() -> mediapipe.FaceFinder:
    found = mediapipe.FaceFinder()
    found._running = Detector()
    return found


def test_the_whole_picture_is_enough(finder):
    boxes = finder.find_boxes(bright(720, 1280, 300, 100, 80))
    assert [(box.x, box.y, box.side) for box in boxes] == [pytest.approx((340, 140, 80))]
    assert finder._running.shapes == [(720, 1280)]


def test_what_is_smaller_is_found_in_a_part_once(finder):
    image = bright(720, 1280, 400, 300, 20)  # in the left part and in the middle one
    assert [(box.x, box.y, box.side) for box in finder.find_boxes(image)] == [pytest.approx((410, 310, 20))]
    assert finder._running.shapes[1:] == [(720, 720)] * 3
    assert finder.find_boxes(image, thorough=False) == []
    finder._running.shapes.clear()
    finder.find_boxes(np.zeros((288, 360, 3), np.uint8))
    assert finder._running.shapes == [(288, 360)]  # a small picture has no parts


def test_a_large_picture_is_reduced_and_the_box_is_not(finder):
    pytest.importorskip("cv2")
    boxes = finder.find_boxes(bright(2160, 3840, 900, 600, 300))
    assert finder._running.shapes == [(720, 1280)]
    assert (boxes[0].x, boxes[0].y, boxes[0].side) == pytest.approx((1050, 750, 300), abs=3)
