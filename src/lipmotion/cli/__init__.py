"""The command line: one file a verb, each a call of the API function of the same name."""
