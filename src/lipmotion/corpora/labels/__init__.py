"""What was said in a recording, from the text files that lie beside it."""

from lipmotion.corpora.labels.beside import Labels, labels_beside, read_labels
from lipmotion.corpora.labels.plain import check_plain

__all__ = ["Labels", "check_plain", "labels_beside", "read_labels"]
