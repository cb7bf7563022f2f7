"""The command line: one file per verb; only here are arguments parsed, results printed and exit codes chosen."""
