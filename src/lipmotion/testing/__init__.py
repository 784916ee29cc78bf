"""For whoever tests or extends lipmotion: the toy corpus."""
