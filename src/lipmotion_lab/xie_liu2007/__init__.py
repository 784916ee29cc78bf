"""The experiments of Xie and Liu 2007, on any corpus."""
