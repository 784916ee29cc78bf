"""Characters as meshes: control points, skinning, blendshapes, and the files that they come in."""
