"""The still parts around the face: background, hair, ears, neck and shoulders."""

from __future__ import annotations

from lipmotion_faces.portrait.design import WHITE, Design
from lipmotion_faces.portrait.layer import Glow, Layer, Rim
from lipmotion_faces.portrait.outlines import both_sides, closed_curve, lowered, open_curve, path_points, stroke
from lipmotion_faces.portrait.view import Pixels, Window


def wall(window: Window, design: Design) -> Layer:
    """Return a layer with the background, opaque."""
    layer, colours = Layer(window), design.palette
    lit = () if design.flat else (Glow(-0.5, -0.5, 1.5, 1.6, colours.wall_light, 0.9),)
    layer.fill(path_points("-9 -9, 9 -9, 9 9, -9 9"), colours.wall, *lit)
    return layer


def behind_head(window: Window, design: Design) -> Layer:
    """Return a layer with what is behind the head: hair, neck, shoulders, ears."""
    layer = Layer(window)
    _hair_behind(layer, design)
    _neck_and_shoulders(layer, design)
    _cap(layer, design)
    _ears(layer, design)
    return layer


def hair(window: Window, design: Design) -> Layer:
    """Return a layer with the hair in front of the forehead."""
    layer, colours = Layer(window), design.palette
    for lock in design.hair:
        shades: list[Glow | Rim] = [] if design.flat else [Rim(0.07, colours.hair_dark, 0.55)]
        if lock.light is not None and not design.flat:
            shades.append(Glow(*lock.light, colours.hair_light, 0.75))
        if not design.flat:
            shadow = lowered(lock.outline, 0.035)
            layer.fill(shadow, colours.skin_deep, opacity=0.4, blur=0.03, within=design.skull)
        layer.fill(lock.outline, colours.hair, *shades)
        for path in lock.strands:
            strand = stroke(open_curve(path), [0, 0.02, 0.016, 0])
            colour = colours.hair_light if design.flat else colours.hair_dark
            strength, soft = (1.0, 0.0) if design.flat else (0.3, 0.006)
            layer.fill(strand, colour, opacity=strength, blur=soft, within=lock.outline)
        layer.contour(lock.outline, design.line, colours.line)
    return layer


def chin_shadow(window: Window, design: Design) -> Pixels:
    """Return the shadow of the head on what is behind it, 0..1 [shape=(h, w)]; the jaw is at rest."""
    layer = Layer(window)
    soft, strength = (0.0, 0.45) if design.flat else (0.045, 0.55)
    layer.fill(lowered(design.skull, 0.12), design.palette.skin_deep, opacity=strength, blur=soft)
    return layer.pixels[..., 3]


def shaded_neck(window: Window, design: Design) -> Layer:
    """Return a layer with the neck in full shadow."""
    layer = Layer(window)
    layer.fill(design.neck, design.palette.skin_deep)
    layer.cut(design.shoulders)
    for part in design.collar:
        layer.cut(part)
    return layer


def _hair_behind(layer: Layer, design: Design) -> None:
    outline, colours = design.hair_behind, design.palette
    if outline is None:
        return
    if design.flat:
        layer.fill(outline, colours.hair_dark)
        layer.contour(outline, design.line, colours.line)
        return
    lit = [Glow(side * 0.98, 1.1, 0.2, 0.75, colours.hair, 1.0) for side in (-1, 1)]
    gleam = Glow(-1.0, 1.2, 0.05, 0.3, colours.hair_light, 0.5)
    layer.fill(outline, colours.hair_dark, *lit, gleam, Rim(0.04, colours.hair_dark, 0.4))
    for inward in (0.05, 0.13, 0.2):
        line = open_curve(
            [(0.9 - inward, 0.5), (0.93 - inward, 0.95), (1 - 1.3 * inward, 1.35), (0.95 - 1.6 * inward, 1.7)]
        )
        for strand in both_sides(stroke(line, [0, 0.014, 0.018, 0])):
            layer.fill(strand, colours.hair_light, opacity=0.22, blur=0.006)


def _neck_and_shoulders(layer: Layer, design: Design) -> None:
    colours = design.palette
    layer.fill(design.neck, colours.skin, *(() if design.flat else (Rim(0.1, colours.skin_shade, 0.7),)))
    layer.contour(design.neck, design.line, colours.line)
    if design.collarbones:
        for bone in both_sides(stroke(open_curve("0.1 1.93, 0.35 1.86, 0.62 1.84"), [0, 0.02, 0])):
            layer.fill(bone, colours.skin_shade, opacity=0.6, blur=0.01)
    if not design.flat:
        shadow = lowered(design.shoulders, -0.02)
        layer.fill(shadow, colours.skin_deep, opacity=0.3, blur=0.03, within=design.neck)
    collars = ((part, colours.collar, colours.collar_dark) for part in design.collar)
    for part, colour, dark in ((design.shoulders, colours.cloth, colours.cloth_dark), *collars):
        light = Glow(-0.9, 1.92, 0.35, 0.12, colours.cloth_light, 0.7)
        layer.fill(part, colour, *(() if design.flat else (Rim(0.1, dark, 0.8), light)))
        layer.contour(part, design.line, colours.line)


def _cap(layer: Layer, design: Design) -> None:
    if design.cap is not None:
        colours = design.palette
        layer.fill(design.cap, colours.hair_dark, *(() if design.flat else (Rim(0.05, colours.hair, 0.5),)))
        layer.contour(design.cap, design.line, colours.line)


def _ears(layer: Layer, design: Design) -> None:
    colours = design.palette
    for ear in both_sides(closed_curve(design.ear)):
        layer.fill(ear, colours.skin, *(() if design.flat else (Rim(0.05, colours.skin_shade, 0.8),)))
        layer.contour(ear, design.line, colours.line)
    for hollow in both_sides(closed_curve(design.ear_hollow)):
        layer.fill(hollow, colours.skin_deep, opacity=0.5, blur=0 if design.flat else 0.012)
    if design.earrings:
        for ring in both_sides(closed_curve("0.775 0.42, 0.8 0.445, 0.775 0.47, 0.75 0.445")):
            layer.fill(ring, colours.gold, Glow(0, 0.43, 9, 0.015, WHITE, 0.6))
