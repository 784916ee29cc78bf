"""The panel of the add-on, and its button. Runs inside Blender."""

from __future__ import annotations

from typing import Any

import bpy

from .keying import key_objects


class LipMotionSettings(bpy.types.PropertyGroup):
    """What the panel asks for."""

    motion: bpy.props.StringProperty(
        name="Motion", description="A .json or .csv of lipmotion, or a take of Live Link Face", subtype="FILE_PATH"
    )
    sound: bpy.props.StringProperty(name="Sound", description="For the sequencer; may be empty", subtype="FILE_PATH")
    first: bpy.props.IntProperty(name="Start frame", default=1)
    replace: bpy.props.BoolProperty(
        name="Replace earlier keys", default=True, description="Off: only keys between the first and the last frame"
    )


class LipMotionKey(bpy.types.Operator):
    """Key the selected objects from the motion file."""

    bl_idname = "lipmotion.key"
    bl_label = "Key selected objects"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    def execute(self, context: Any) -> set[str]:
        """Key them, and say what was found."""
        settings = context.scene.lipmotion
        objects = list(dict.fromkeys([each for each in (context.object, *context.selected_objects) if each]))
        if not objects:
            self.report({"ERROR"}, "Select the face or the rig first")
            return {"CANCELLED"}
        options = {"first": settings.first, "replace": settings.replace, "sound": bpy.path.abspath(settings.sound)}
        try:
            used, left = key_objects(objects, bpy.path.abspath(settings.motion), context.scene, **options)
        except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
            self.report({"ERROR"}, f"{settings.motion}: cannot be read as motion: {error}")
            return {"CANCELLED"}
        if not used:
            names = ", ".join(left[:4])
            self.report({"ERROR"}, f"No shape key or bone has the name of a curve: {names}, ...")
            return {"CANCELLED"}
        self.report({"INFO"}, f"{used} curves keyed, {len(left)} without a shape key or bone: {', '.join(left[:6])}")
        return {"FINISHED"}


class LipMotionPanel(bpy.types.Panel):
    """The panel in the sidebar of the 3D view."""

    bl_idname = "VIEW3D_PT_lipmotion"
    bl_label = "lipmotion"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "lipmotion"

    def draw(self, context: Any) -> None:
        """Show the settings and the button."""
        for name in ("motion", "sound", "first", "replace"):
            self.layout.prop(context.scene.lipmotion, name)
        self.layout.operator(LipMotionKey.bl_idname)


CLASSES = (LipMotionSettings, LipMotionKey, LipMotionPanel)


def register() -> None:
    """Make the classes known to Blender."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.lipmotion = bpy.props.PointerProperty(type=LipMotionSettings)


def unregister() -> None:
    """Forget them."""
    del bpy.types.Scene.lipmotion
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
