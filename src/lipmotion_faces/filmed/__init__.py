"""A filmed face: mouth and jaw of a person, for any motion, stitched into the person's own footage."""
