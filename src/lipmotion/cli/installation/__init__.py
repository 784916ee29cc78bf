"""What is installed: the packages that lipmotion declares, and a look at each part. NumPy may be missing here."""
