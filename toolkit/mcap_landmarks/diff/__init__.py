"""Two runs, or two maps, held against each other."""
