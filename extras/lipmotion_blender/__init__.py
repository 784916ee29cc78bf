"""Lip motion in Blender: a panel in the sidebar of the 3D view that keys shape keys and bones from a motion file."""

from __future__ import annotations

from .keying import key_frames, key_objects

__all__ = ["bl_info", "key_frames", "key_objects", "register", "unregister"]

bl_info = {
    "name": "lipmotion",
    "author": "lipmotion",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "3D View > Sidebar > lipmotion",
    "description": "Keys shape keys and bones from files of lip motion",
    "category": "Animation",
}


def register() -> None:
    """Add the panel to Blender."""
    from . import panel

    panel.register()


def unregister() -> None:
    """Remove the panel from Blender."""
    from . import panel

    panel.unregister()
