"""The unit selection engine: recorded motion, chosen and joined (Minnis & Breen 2000)."""
