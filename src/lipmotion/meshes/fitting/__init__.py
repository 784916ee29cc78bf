"""Motion to the points and blendshapes of a mesh, and back."""
