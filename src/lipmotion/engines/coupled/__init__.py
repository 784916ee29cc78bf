"""Coupled hidden Markov models of speech and lips, and EM conversion from one to the other (Xie & Liu 2007)."""
