"""What was said in a recording, from the text files that lie beside it."""

from lipmotion.corpora.labels.label_files import RecordingLabels, labels_beside, read_labels
from lipmotion.corpora.labels.plain_text import check_plain_text

__all__ = ["RecordingLabels", "check_plain_text", "labels_beside", "read_labels"]
