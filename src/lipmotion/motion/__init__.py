"""What all engines share once motion is predicted: its space, rest pose, closures, parameter generation, scaling."""
