"""The verbs of the command line: each calls the API function of the same name."""
