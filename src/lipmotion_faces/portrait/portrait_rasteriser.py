"""Poses of a motion, and their pictures. The portrait is painted once; for each frame only what moves is painted."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import CALM, UpperFace
from lipmotion.articulation.mouth import find_mouth
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import SCENE, Picture, Staging, stage_liveliness
from lipmotion_faces.kernels.painting import stack, warp, warp_bytes
from lipmotion_faces.portrait import geometry
from lipmotion_faces.portrait.design import (
    WHITE,
    Colour,
    Design,
    Knots,
    Points,
    close_curve,
    list_path_points,
    make_ellipse,
    mirror_outline,
    move_down,
    open_curve,
    stroke,
)
from lipmotion_faces.portrait.layer import Glow, Layer, Pixels, Rim, View, Window, lay_over
from lipmotion_faces.portrait.mouth_painting import MouthPainter

LID_POSITIONS = 16
MOOD_LIDS = 8  # positions of the lids on the way to a mood
WIDE_RISE, SQUINT_RISE, SQUINT_FALL, LID_SLANT = 0.045, 0.055, 0.025, 0.045
"""How far a mood raises the upper lids, and the lower ones, and how far it then lowers the upper ones; how far lowered
brows take the inner half of the upper lids with them, and brows raised at their inner ends leave the outer half."""
CHEEK_SQUINT = 0.8  # raised cheeks narrow the eyes by this part
GAZE_STEPS = 8  # positions of the gaze in a pixel


class LidPose(NamedTuple):
    """Lids and furrows in steps: ``LID_POSITIONS`` when shut, ``MOOD_LIDS`` in moods; slant < 0: outwards."""

    shut: int
    wide: int = 0
    squint: int = 0
    slant: int = 0
    furrow: int = 0
    sneer: int = 0


class EyePainter:
    """Paints both eyes of a character, with the lids.

    lids : by the pose of the lids: what is under the irises, the openings between the lids, what is over the irises
    """

    def __init__(self, design: Design, window: Window) -> None:
        self._design, self._window = design, window
        layer, colours, eyes = Layer(window), design.palette, design.eyes
        y, r = eyes.y, eyes.iris
        for x in (eyes.x, -eyes.x):
            if design.flat:
                layer.fill(make_ellipse(x, y, r, r), colours.iris)
                layer.fill(make_ellipse(x, y, 0.6 * r, 0.6 * r), colours.pupil)
                layer.fill(make_ellipse(x - 0.3 * r, y - 0.35 * r, 0.28 * r, 0.28 * r), WHITE)
                continue
            light = Glow(x, y + 0.5 * r, 0.6 * r, 0.4 * r, colours.iris_light, 0.9)
            layer.fill(make_ellipse(x, y, r, r), colours.iris, Rim(0.16 * r, colours.iris_dark, 1.0), light)
            layer.fill(make_ellipse(x, y, 0.46 * r, 0.46 * r), colours.pupil)
            layer.fill(make_ellipse(x - 0.3 * r, y - 0.32 * r, 0.22 * r, 0.22 * r), WHITE, opacity=0.95)
            layer.fill(make_ellipse(x + 0.32 * r, y + 0.34 * r, 0.11 * r, 0.11 * r), WHITE, opacity=0.6)
        self.iris = layer.pixels
        self.lids = lru_cache(maxsize=2 * LID_POSITIONS)(self._paint_lids)
        self._cached = lru_cache(maxsize=128)(self._paint)

    def paint(self, shut: float, gaze_x: float, gaze_y: float, mood: UpperFace = CALM) -> Pixels:
        """Return the eyes, premultiplied [shape=(h, w, 4)], not to be changed; gaze right and down, eye distances."""
        step = self._window.view.scale * GAZE_STEPS
        slant = mood.lowered * (1 - mood.inner) - 0.8 * mood.inner * (1 - mood.outer) * (1 - mood.wide)
        furrow = mood.lowered * (1 - 0.5 * mood.inner)
        squint = max(mood.squint, CHEEK_SQUINT * mood.cheek)
        steps = (round(share * MOOD_LIDS) for share in (mood.wide, squint, slant, furrow, mood.sneer))
        return self._cached(LidPose(round(shut * LID_POSITIONS), *steps), round(gaze_x * step), round(gaze_y * step))

    def _paint(self, lids: LidPose, gaze_x: int, gaze_y: int) -> Pixels:
        under, almond, over = self.lids(lids)
        iris = np.empty_like(self.iris)
        grid = np.ones((2, 2))
        warp(self.iris, -gaze_x / GAZE_STEPS * grid, -gaze_y / GAZE_STEPS * grid, max(iris.shape[:2]), iris)
        iris *= almond[..., None]
        return over + (1 - over[..., 3:]) * (iris + (1 - iris[..., 3:]) * under)

    def _paint_lids(self, lids: LidPose) -> tuple[Pixels, NDArray[np.float32], Pixels]:
        """Return what is under the irises, the openings between the lids, and what is over the irises."""
        shut, design = lids.shut / LID_POSITIONS, self._design
        colours, eyes, flat = design.palette, design.eyes, design.flat
        upper, lower = _place_lid_edges(design, lids)
        highest = tuple(min(pair, key=lambda knot: knot[1]) for pair in zip(eyes.upper, upper, strict=True))
        under, almond, over = Layer(self._window), Layer(self._window), Layer(self._window)
        for side in (1, -1):
            flip, x = np.array([side, 1.0]), side * eyes.x
            top, bottom = open_curve(upper) * flip, open_curve(lower) * flip
            outline = np.vstack([open_curve(highest) * flip, (open_curve(eyes.lower) * flip)[::-1]])
            opening = np.vstack([top, bottom[::-1]])
            soft: tuple[Rim | Glow, ...] = ()
            ball: tuple[Rim | Glow, ...] = ()
            if not flat:
                soft = Rim(0.03, colours.skin_shade, 0.6), Glow(x, 0.0, 0.1, 0.05, colours.skin_light, 0.5)
                ball = Glow(x, -0.13, 0.2, 0.06, colours.eye_shade, 0.75), Rim(0.015, colours.skin_deep, 0.25)
            under.fill(outline, colours.skin, *soft)
            if shut < 0.92:
                under.fill(opening, colours.eye_white, *ball)
                almond.fill(opening, WHITE)
                if not flat:
                    corner = make_ellipse(side * 0.2, 0.028, 0.022, 0.016)
                    under.fill(corner, colours.eye_corner, within=opening, blur=0.004)
                    over.fill(make_ellipse(x, -0.12, 0.12, 0.05), colours.pupil, opacity=0.3, blur=0.02, within=opening)
            if not flat:
                over.fill(stroke(bottom, [0.004, 0.01, 0.014, 0.012]), colours.skin_deep, opacity=0.5, blur=0.004)
                ends = (*eyes.upper[1:-1], (eyes.upper[-1][0] + 0.02, -0.01))
                fold = open_curve([(x, min(y, -0.02) - 0.045 + 0.03 * shut) for x, y in ends]) * flip
                over.fill(stroke(fold, [0, 0.014, 0.012, 0]), colours.skin_deep, opacity=0.55, blur=0.006)
            widths = [eyes.lashes * width for width in (0.012, 0.03, 0.036, 0.034, 0.02)]
            over.fill(stroke(top, widths), colours.lashes)
            if flat:
                over.fill(stroke(bottom, [0.01] * 3), colours.lashes)
            elif eyes.lashes > 0.5:
                x, y = upper[-1]
                root_y = y + 0.35 * (upper[-2][1] - y)
                wing = open_curve([(x - 0.03, root_y), (x + 0.015, y - 0.012), (x + 0.046, y - 0.04)])
                over.fill(stroke(wing, [0.03, 0.02, 0]) * flip, colours.lashes)
            self._paint_furrows(over, lids, flip)
        return under.pixels, almond.pixels[..., 3], over.pixels

    def _paint_furrows(self, layer: Layer, lids: LidPose, flip: Points) -> None:
        """Paint the furrow beside the middle of lowered brows, and the wrinkles of the nose."""
        colours, flat = self._design.palette, self._design.flat
        colour, soft = (colours.line, 0.0) if flat else (colours.skin_deep, 0.006)
        if lids.furrow:
            line = stroke(open_curve([(0.05, -0.215), (0.042, -0.15), (0.055, -0.085)]), [0.0, 0.02, 0.0])
            layer.fill(line * flip, colour, opacity=0.75 * lids.furrow / MOOD_LIDS, blur=soft)
        if lids.sneer:
            for y in (-0.02, 0.045, 0.11):
                line = stroke(open_curve([(0.015, y), (0.06, y + 0.012), (0.105, y + 0.045)]), [0.008, 0.018, 0.0])
                layer.fill(line * flip, colour, opacity=0.65 * lids.sneer / MOOD_LIDS, blur=soft)


def _place_lid_edges(design: Design, lids: LidPose) -> tuple[Knots, Knots]:
    shut, (wide, squint, slant, *_) = lids.shut / LID_POSITIONS, (steps / MOOD_LIDS for steps in lids[1:])
    upper, lower = design.eyes.upper, design.eyes.lower
    if lids[1:] != (0,) * len(lids[1:]):  # the corners stay
        bow = (0.0, 0.8, 1.0, 0.8, 0.0)
        half = (0.0, 1.0, 0.6, 0.15, 0.0) if slant > 0 else (0.0, 0.15, 0.6, 1.0, 0.0)
        moved = [
            (SQUINT_FALL * squint - WIDE_RISE * wide) * a + LID_SLANT * abs(slant) * b
            for a, b in zip(bow, half, strict=True)
        ]
        upper = tuple((x, y + by) for (x, y), by in zip(upper, moved, strict=True))
        lower = tuple((x, y - SQUINT_RISE * squint * share) for (x, y), share in zip(lower, bow, strict=True))
    return tuple((x, y + shut * (low - y)) for (x, y), (_, low) in zip(upper, lower, strict=True)), lower


def paint_still_layers(whole: Window, design: Design, background: Colour | str | None) -> tuple[Pixels, ...]:
    """Return the layers of a character without eyes and mouth: premultiplied colour 0..255, and cover 0..1.

    In this order: the skin of the head, with the strength of its shadow on what is behind it as one more channel
    [shape=(h, w, 5)]; what is behind it; what is added to that where the shadow falls; what is in front of the skin;
    and all of them over one another, at rest [each shape=(h, w, 4)].
    """
    colours, flat, wall = design.palette, design.flat, Layer(whole)
    if background == SCENE:
        lit = () if flat else (Glow(-0.5, -0.5, 1.5, 1.6, colours.wall_light, 0.9),)
        wall.fill(list_path_points("-9 -9, 9 -9, 9 9, -9 9"), colours.wall, *lit)
    elif background is not None:
        wall.pixels[...] = (*background, 1)
    below = lay_over(paint_behind_head(whole, design).pixels, wall.pixels)
    dark_neck, shadow = Layer(whole), Layer(whole)
    dark_neck.fill(design.neck, colours.skin_deep)
    for part in (design.shoulders, *design.collar):
        dark_neck.cut(part)
    shade = lay_over(dark_neck.pixels, below) - below
    soft, strength = (0.0, 0.45) if flat else (0.045, 0.55)  # of the head's shadow; the jaw is at rest
    shadow.fill(move_down(design.skull, 0.12), colours.skin_deep, opacity=strength, blur=soft)
    cover = shadow.pixels[..., 3]
    skin, front = paint_head(whole, design).pixels, paint_hair(whole, design).pixels
    still = lay_over(front, lay_over(skin, below + cover[..., None] * shade))
    return np.dstack([skin, cover]), below, shade, front, still


def paint_behind_head(window: Window, design: Design) -> Layer:
    """Return a layer with what is behind the head: hair, neck, shoulders, ears."""
    layer, colours, flat = Layer(window), design.palette, design.flat

    if design.hair_behind is not None:
        lit = [Glow(side * 0.98, 1.1, 0.2, 0.75, colours.hair, 1.0) for side in (-1, 1)]
        gleam = Glow(-1.0, 1.2, 0.05, 0.3, colours.hair_light, 0.5)
        _fill_outlined(
            layer, design, design.hair_behind, colours.hair_dark, *lit, gleam, Rim(0.04, colours.hair_dark, 0.4)
        )
        for inward in () if flat else (0.05, 0.13, 0.2):
            line = [(0.9 - inward, 0.5), (0.93 - inward, 0.95), (1 - 1.3 * inward, 1.35), (0.95 - 1.6 * inward, 1.7)]
            for strand in mirror_outline(stroke(open_curve(line), [0, 0.014, 0.018, 0])):
                layer.fill(strand, colours.hair_light, opacity=0.22, blur=0.006)
    _fill_outlined(layer, design, design.neck, colours.skin, Rim(0.1, colours.skin_shade, 0.7))
    if design.collarbones:
        for bone in mirror_outline(stroke(open_curve("0.1 1.93, 0.35 1.86, 0.62 1.84"), [0, 0.02, 0])):
            layer.fill(bone, colours.skin_shade, opacity=0.6, blur=0.01)
    if not flat:
        shadow = move_down(design.shoulders, -0.02)
        layer.fill(shadow, colours.skin_deep, opacity=0.3, blur=0.03, within=design.neck)
    collars = ((part, colours.collar, colours.collar_dark) for part in design.collar)
    for part, colour, dark in ((design.shoulders, colours.cloth, colours.cloth_dark), *collars):
        _fill_outlined(
            layer, design, part, colour, Rim(0.1, dark, 0.8), Glow(-0.9, 1.92, 0.35, 0.12, colours.cloth_light, 0.7)
        )
    if design.cap is not None:
        _fill_outlined(layer, design, design.cap, colours.hair_dark, Rim(0.05, colours.hair, 0.5))
    _paint_ears(layer, design)
    return layer


def _paint_ears(layer: Layer, design: Design) -> None:
    colours = design.palette
    for ear in mirror_outline(close_curve(design.ear)):
        _fill_outlined(layer, design, ear, colours.skin, Rim(0.05, colours.skin_shade, 0.8))
    for hollow in mirror_outline(close_curve(design.ear_hollow)):
        layer.fill(hollow, colours.skin_deep, opacity=0.5, blur=0 if design.flat else 0.012)
    if design.earrings:
        for ring in mirror_outline(close_curve("0.775 0.42, 0.8 0.445, 0.775 0.47, 0.75 0.445")):
            layer.fill(ring, colours.gold, Glow(0, 0.43, 9, 0.015, WHITE, 0.6))


def _fill_outlined(layer: Layer, design: Design, outline: Points, colour: Colour, *shades: Glow | Rim) -> None:
    layer.fill(outline, colour, *(() if design.flat else shades))
    layer.paint_contour(outline, design.line, design.palette.line)


def paint_head(window: Window, design: Design) -> Layer:
    """Return a layer with the bald head without eyes and mouth."""
    layer, colours, skull = Layer(window), design.palette, design.skull
    if design.flat:
        inner = skull * (0.86, 0.97) + (-0.06, -0.02)
        unlit = np.vstack([skull[skull[:, 0] >= 0], inner[inner[:, 0] >= 0][::-1]])
        layer.fill(skull, colours.skin)
        layer.fill(unlit, colours.skin_shade, opacity=0.5, within=skull)
        for cheek in (-1, 1):
            layer.fill(make_ellipse(cheek * 0.46, 0.5, 0.13, 0.08), colours.blush, opacity=design.blush)
        layer.fill(make_ellipse(0.03, 0.52, 0.1, 0.06), colours.skin_shade, opacity=0.55)
        nose = open_curve("-0.1 0.5, -0.075 0.565, 0.0 0.585, 0.075 0.565, 0.1 0.5")
        layer.fill(stroke(nose, [0.0, 0.024, 0.026, 0.024, 0.0]), colours.line)
        layer.paint_contour(skull, design.line, colours.line)
    else:
        glows = [Glow(-0.05, -0.35, 0.5, 0.35, colours.skin_light, 0.55)]
        glows.append(Glow(0.0, 1.24, 0.16, 0.09, colours.skin_light, 0.45))
        for side in (-1, 1):
            glows += [
                Glow(side * 0.43, 0.54, 0.23, 0.18, colours.blush, design.blush),
                Glow(side * 0.36, 0.30, 0.2, 0.1, colours.skin_light, 0.5),
                Glow(side * 0.34, -0.08, 0.24, 0.12, colours.skin_shade, 0.38),
            ]
        layer.fill(skull, colours.skin, Rim(0.16, colours.skin_shade, 0.62), *glows)
        if design.beard:
            y = design.lips.line_y
            for x, at, wide, high in ((0, y + 0.28, 0.46, 0.26), (-0.5, y - 0.02, 0.2, 0.3), (0.5, y - 0.02, 0.2, 0.3)):
                spot = make_ellipse(x, at, wide, high)
                layer.fill(spot, colours.beard, opacity=design.beard, blur=0.09, within=skull)
            layer.fill(make_ellipse(0, y - 0.15, 0.26, 0.07), colours.beard, opacity=0.8 * design.beard, blur=0.05)
        _paint_nose(layer, design)
    brow_colour, strength, soft = (colours.hair_dark, 1.0, 0.0) if design.flat else (colours.hair, 0.92, 0.007)
    for brow in mirror_outline(stroke(open_curve(design.eyes.brow), design.eyes.brow_widths)):
        layer.fill(brow, brow_colour, opacity=strength, blur=soft)
    return layer


def _paint_nose(layer: Layer, design: Design) -> None:
    colours, wide = design.palette, (design.nose_width, 1.0)
    layer.fill(make_ellipse(0, 0.61, 0.19, 0.06) * wide, colours.skin_shade, opacity=0.75, blur=0.03)
    layer.fill(make_ellipse(0, 0.545, 0.13, 0.075) * wide, colours.skin_light, opacity=0.7, blur=0.04)
    sides = mirror_outline(stroke(open_curve("0.125 -0.1, 0.085 0.12, 0.1 0.36"), [0.03, 0.05, 0.02]) * wide)
    for bridge, opacity in zip(sides, (0.45, 0.25), strict=True):
        layer.fill(bridge, colours.skin_shade, opacity=opacity, blur=0.025)
    for wing in mirror_outline(stroke(open_curve("0.155 0.5, 0.195 0.57, 0.165 0.635"), [0, 0.022, 0]) * wide):
        layer.fill(wing, colours.skin_deep, opacity=0.6, blur=0.008)
    for nostril in mirror_outline(stroke(open_curve("0.035 0.632, 0.085 0.615, 0.135 0.632"), [0, 0.034, 0]) * wide):
        layer.fill(nostril, colours.skin_deep, opacity=0.9, blur=0.005)
    base = stroke(open_curve("-0.04 0.645, 0 0.655, 0.04 0.645"), [0, 0.012, 0])
    layer.fill(base, colours.skin_deep, opacity=0.5, blur=0.006)
    layer.fill(make_ellipse(-0.02, 0.3, 0.03, 0.2) * wide, colours.skin_light, opacity=0.6, blur=0.03)
    layer.fill(make_ellipse(-0.02, 0.545, 0.035, 0.022), WHITE, opacity=0.45, blur=0.015)
    layer.fill(make_ellipse(0, 0.745, 0.028, 0.06), colours.skin_shade, opacity=0.4, blur=0.02)
    for ridge in mirror_outline(make_ellipse(0.052, 0.76, 0.014, 0.05)):
        layer.fill(ridge, colours.skin_light, opacity=0.5, blur=0.016)


def paint_hair(window: Window, design: Design) -> Layer:
    """Return a layer with the hair in front of the forehead."""
    layer, colours = Layer(window), design.palette
    strand_colour, strength, soft = (colours.hair_light, 1.0, 0.0) if design.flat else (colours.hair_dark, 0.3, 0.006)
    for lock in design.hair:
        shades: list[Glow | Rim] = []
        if not design.flat:
            shades.append(Rim(0.07, colours.hair_dark, 0.55))
            if lock.light is not None:
                shades.append(Glow(*lock.light, colours.hair_light, 0.75))
            shadow = move_down(lock.outline, 0.035)
            layer.fill(shadow, colours.skin_deep, opacity=0.4, blur=0.03, within=design.skull)
        layer.fill(lock.outline, colours.hair, *shades)
        for path in lock.strands:
            strand = stroke(open_curve(path), [0, 0.02, 0.016, 0])
            layer.fill(strand, strand_colour, opacity=strength, blur=soft, within=lock.outline)
        layer.paint_contour(lock.outline, design.line, colours.line)
    return layer


Bytes = NDArray[np.uint8]
Canvas = NDArray[np.uint16]
RESTING_LIDS = 0.07  # awake and calm, the upper lids cover a little of the irises
LOOK, YAW, PITCH = 0.25, 0.3, 0.4
"""How far an iris moves for an angle of the eyes, and features for angles of the head, in eye distances a radian."""
SWAY_X, SWAY_Y = 0.25, 0.12  # how far the head moves to the side and up for the same angles
LARGEST_TURN = np.array([0.35, 0.35, 0.13])
"""The furthest that a drawing turns to its left, upwards and to its left shoulder, in radians."""


class FacePose(NamedTuple):
    """Everything that moves in a frame; lengths in eye distances, gaze to the right and down, lids closed 0..1."""

    mouth: geometry.MouthPose
    lids: float = 0.0
    gaze_x: float = 0.0
    gaze_y: float = 0.0
    brows: float = 0.0
    head: geometry.HeadPlacement = geometry.HeadPlacement()
    mood: UpperFace = CALM


def list_face_poses(
    motion: Motion, units: Timeline[Unit], fps: float, staging: Staging, prosody: Prosody | None = None
) -> list[FacePose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds. Raises InputError: as ``find_mouth``."""
    mouth = find_mouth(motion, units, fps)
    moved = stage_liveliness(np.arange(len(mouth.gap)) / fps, motion, units, staging, prosody)
    gaze = LOOK * moved.gaze
    yaw, pitch, roll = np.clip(moved.turn, -LARGEST_TURN, LARGEST_TURN).T
    heads = np.stack([SWAY_X * yaw, -SWAY_Y * pitch, roll, YAW * yaw, -PITCH * pitch], axis=1)
    lids, rows = np.maximum(moved.lids, RESTING_LIDS), mouth.with_corners(moved.unit(12), moved.unit(15)).rows()
    return [
        FacePose(
            geometry.MouthPose(*(row[name] for name in geometry.MouthPose._fields)),
            shut,
            x,
            -y,
            brows,
            geometry.HeadPlacement(*head),
            mood,
        )
        for row, shut, (x, y), brows, head, mood in zip(
            rows, lids.tolist(), gaze.tolist(), moved.brows.tolist(), heads.tolist(), moved.upper_face, strict=True
        )
    ]


class Rasteriser:
    """Draws a character at one size; ``paint`` may be called by several threads, each of which has its own canvas."""

    def __init__(self, design: Design, size: int, background: Colour | str | None = SCENE) -> None:
        view, line_y = View(size), design.lips.line_y
        whole = view.cut_window(-9, -9, 9, 9)
        self._opaque, self._canvases = background is not None, threading.local()
        self._jaw = view.cut_window(-0.86, line_y - 0.5, 0.86, line_y + 0.95)
        self._mouth = view.cut_window(-0.56, line_y - 0.24, 0.56, line_y + 0.7)
        self._eyes, self._brow = view.cut_window(-0.66, -0.24, 0.66, 0.21), view.cut_window(-0.8, -0.64, 0.8, -0.06)
        # the part of the eyes' window that the brows' does not have
        self._below_brows = Window(view, self._eyes.x0, self._brow.y1, self._eyes.x1, self._eyes.y1)
        self._head = view.cut_window(-1.3, -9, 1.3, 1.9)
        self._skin, self._below, self._shade, self._front, still = paint_still_layers(whole, design, background)
        self._eye_painter = EyePainter(design, self._eyes)
        self._still = (still * (1, 1, 1, 255) + 0.5).astype(np.uint16)
        self._frame = self._still[..., : 3 if self._opaque else 4].astype(np.uint8)
        self._brows = lru_cache(maxsize=64)(self._paint_brows)
        self._skin_field, self._brow_field = geometry.SkinField(self._jaw, design.lips), geometry.BrowField(self._brow)
        self._head_field = geometry.HeadField(self._head)
        self._mouth_painter = MouthPainter(design, self._mouth)

    def make_canvas(self) -> Canvas:
        """Return the picture of the resting face without eyes and mouth, to draw on [shape=(size, size, 4)]."""
        return self._still.copy()

    def paint(self, pose: FacePose) -> Picture:
        """Return one frame, drawn on the canvas of the thread that calls; shape as of ``draw``."""
        if not hasattr(self._canvases, "own"):
            self._canvases.own = self.make_canvas()
        return self.draw(pose, self._canvases.own)

    def draw(self, pose: FacePose, canvas: Canvas) -> Bytes:
        """Return one frame [shape=(size, size, 3), or 4 channels where transparent]; the canvas is changed."""
        skin = self._move_skin(self._jaw, self._skin_field.shift(pose.mouth, pose.mood))
        self._mouth_painter.paint(skin[self._mouth.find_area(self._jaw)][..., :4], pose.mouth)
        self._lay(skin, self._jaw, canvas[self._jaw.area])
        mood, steps = pose.mood, geometry.MOOD_STEPS
        raised = round(pose.brows * geometry.BROW_STEPS * self._brow.view.scale)
        of_mood = (round(share * steps) for share in (mood.inner, mood.outer, mood.lowered))
        canvas[self._brow.area] = self._brows(geometry.BrowPose(raised, *of_mood))
        canvas[self._below_brows.area] = self._still[self._below_brows.area]
        eyes = self._eye_painter.paint(pose.lids, pose.gaze_x, pose.gaze_y, pose.mood)
        mixed = eyes * np.array([1, 1, 1, 255], np.float32)
        mixed += (1 - eyes[..., 3:]) * canvas[self._eyes.area]
        mixed += np.float32(0.5)
        canvas[self._eyes.area] = mixed
        frame = self._frame.copy()
        area = self._head.area
        warp_bytes(canvas[area], *self._head_field.shift(pose.head), geometry.STEP, frame[area])
        if not self._opaque:  # straight alpha, as files store it
            cover = frame[..., 3:].astype(np.uint16)
            edge = (cover[..., 0] > 0) & (cover[..., 0] < 255)
            colours = (frame[edge, :3].astype(np.uint16) * 255 + cover[edge] // 2) // cover[edge]
            frame[edge, :3] = np.minimum(colours, 255)
        return frame

    def _paint_brows(self, brows: geometry.BrowPose) -> Canvas:
        picture = np.empty_like(self._still[self._brow.area])
        self._lay(self._move_skin(self._brow, self._brow_field.shift(brows)), self._brow, picture)
        return picture

    def _move_skin(self, window: Window, shifts: tuple[NDArray[np.float64], NDArray[np.float64]]) -> Pixels:
        source = self._skin[window.area]
        skin = np.empty_like(source)
        warp(source, *shifts, geometry.STEP, skin)
        return skin

    def _lay(self, skin: Pixels, window: Window, target: Canvas) -> None:
        area = window.area
        stack(self._below[area], self._shade[area], skin, self._front[area], target)
