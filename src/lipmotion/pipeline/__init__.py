"""The main path: recordings to a corpus, a corpus to a model, speech to motion and files."""
