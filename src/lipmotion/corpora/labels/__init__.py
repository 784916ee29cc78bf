"""What was said in a recording, from the text files that lie beside it."""

from lipmotion.corpora.labels.beside import Labels, labels_beside, read_labels

__all__ = ["Labels", "labels_beside", "read_labels"]
