"""What the answers of a study say: preferences, opinion scores, and how sure they are."""
