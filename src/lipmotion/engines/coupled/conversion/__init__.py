"""Speech to motion: the inverse of training (Xie & Liu 2007, §4)."""
