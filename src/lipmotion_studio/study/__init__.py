"""Studies: people watch talking faces and say what they see; their answers are collected and analysed."""
