"""All experiments on a corpus, and one page of what they found."""
