"""Arguments that several verbs have."""
