"""Files of characters: which reader a name asks for."""

from __future__ import annotations

from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.meshes.files.gltf_scene import read_gltf
from lipmotion.meshes.files.obj_files import read_obj, read_obj_folder
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.shape_names import is_known
from lipmotion.storage.sources import check_kind

GLTF_SUFFIXES = (".glb", ".gltf", ".vrm")
OBJ_SUFFIX = ".obj"
CHARACTER_SUFFIXES = (*GLTF_SUFFIXES, OBJ_SUFFIX)


def read_character(path: str | Path) -> Mesh:
    """Return the mesh of a character: a ``.glb``, ``.gltf``, ``.vrm`` or ``.obj`` file, or a folder of OBJ files.

    Of a folder, files whose names are understood as blendshapes are read (``jawOpen.obj``); if there are none, all.
    Raises InputError: another kind of file, damaged, or too large.
    """
    path = Path(path)
    if path.is_dir():
        names = [each.stem for each in path.glob("*.[oO][bB][jJ]")]
        return read_obj_folder(path, is_known if any(map(is_known, names)) else lambda _: True)
    check_kind(path, "character")
    if path.suffix.lower() in GLTF_SUFFIXES:
        return read_gltf(path)
    if path.suffix.lower() == OBJ_SUFFIX:
        return read_obj(path)
    raise InputError(
        f"{path}: a character is one of {' '.join(CHARACTER_SUFFIXES)}, or a folder of .obj files; export it as .glb"
    )
