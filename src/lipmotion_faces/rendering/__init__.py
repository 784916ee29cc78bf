"""Pictures of meshes without a graphics card."""
