"""What the answers of a study say: preferences, opinion scores, rankings, and how sure they are."""
