"""The command line: one module for each verb; each calls the API function of the same name."""
