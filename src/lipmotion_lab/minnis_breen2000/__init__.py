"""The comparisons of Minnis & Breen 2000."""
