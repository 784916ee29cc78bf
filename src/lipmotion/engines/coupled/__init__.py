"""Chains of hidden states that may run apart, speech in one and lips in another (Xie & Liu 2007)."""
