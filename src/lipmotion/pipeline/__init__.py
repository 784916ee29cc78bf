"""The main functions: recordings to a corpus, a corpus to a model, speech to motion and to files."""
