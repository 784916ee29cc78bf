"""What vision measures and faces draw: the mouth region and the space of its pictures."""
