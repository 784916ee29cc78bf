"""A character's surface, bones, blendshapes and control points, as values."""
