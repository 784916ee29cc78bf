"""Speech of anyone: phones by a network that was trained on thousands of people, and English words in what it finds."""
